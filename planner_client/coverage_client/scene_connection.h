// SPDX-License-Identifier: Apache-2.0
// A scene on a coverage server. If a call finds that the server has lost it, it is built again.
#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <chrono>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/status/status_macros.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/coverage_service.grpc.pb.h"
#include "sightline/v1/job_service.grpc.pb.h"

namespace sightline {

// The i-th of vectors whose coordinates follow each other.
inline Eigen::Vector3f VectorAt(const google::protobuf::RepeatedField<float>& field, int i) {
  return {field[3 * i], field[3 * i + 1], field[3 * i + 2]};
}

// Measurements [begin, end) of a call.
struct CallSlice {
  size_t begin;
  size_t end;
};

// One connection; replaced after a restart of the server.
struct CoverageConnection {
  std::unique_ptr<v1::CoverageService::Stub> coverage;
  std::unique_ptr<v1::JobService::Stub> jobs;
};

// Thread-safe after Prepare.
class SceneConnection {
 public:
  SceneConnection(CoverageClientOptions options, CoverageTask task);

  // Uploads missing parts, has the scene built and fetches its targets.
  absl::Status Prepare();

  const CoverageClientOptions& options() const { return options_; }
  const CoverageTask& task() const { return task_; }
  const v1::SceneSpec& spec() const { return spec_; }
  const SceneInfo& info() const { return info_; }
  const TargetSet& targets() const { return targets_; }
  const TargetBits& measurable() const { return measurable_; }
  const std::vector<uint64_t>& measurable_orientations() const { return measurable_orientations_; }
  // How often the scene was made again because the server had lost it.
  int recoveries() const { return recoveries_; }

  // Calls until it succeeds or fails for a reason that does not pass.
  absl::Status WithRetries(const std::function<absl::Status(CoverageConnection&)>& call);

  // Sends one request per slice, several at a time, and tries again those that failed for a reason
  // that passes. `fill` makes the request of a slice; `method` is a unary call of the asynchronous
  // stub; responses[i] answers slices[i]. All runs on the calling thread. Not gRPC's callback
  // interface: in 1.51 the threads behind it abort the process when its last channel is destroyed
  // soon after a call (ref_counted.h: prior > 0).
  template <typename Request, typename Response>
  absl::Status Pipeline(const std::vector<CallSlice>& slices,
                        const std::function<void(const CallSlice&, Request*)>& fill,
                        std::unique_ptr<grpc::ClientAsyncResponseReader<Response>> (
                            v1::CoverageService::Stub::*method)(grpc::ClientContext*,
                                                                const Request&,
                                                                grpc::CompletionQueue*),
                        std::vector<Response>* responses) {
    struct Pending {
      size_t slice = 0;
      grpc::ClientContext context;
      grpc::Status status;
      std::unique_ptr<grpc::ClientAsyncResponseReader<Response>> reader;
    };
    responses->assign(slices.size(), Response());
    std::deque<size_t> todo;
    for (size_t i = 0; i < slices.size(); ++i) todo.push_back(i);
    Attempts attempts;
    while (!todo.empty()) {
      const int asked_generation = generation_;
      const std::shared_ptr<CoverageConnection> used = connection();
      grpc::CompletionQueue queue;
      std::map<size_t, Pending> under_way;  // by slice
      std::vector<size_t> failed;
      absl::Status error;
      while (!under_way.empty() || (!todo.empty() && error.ok())) {
        if (!todo.empty() && error.ok() &&
            under_way.size() < static_cast<size_t>(options_.outstanding_requests)) {
          const size_t slice = todo.front();
          todo.pop_front();
          Pending& pending = under_way[slice];
          pending.slice = slice;
          Request request;
          fill(slices[slice], &request);
          pending.reader = (used->coverage.get()->*method)(&pending.context, request, &queue);
          pending.reader->Finish(&(*responses)[slice], &pending.status, &pending);
          continue;
        }
        void* tag = nullptr;
        bool ok = false;
        queue.Next(&tag, &ok);
        const auto* finished = static_cast<const Pending*>(tag);
        const size_t slice = finished->slice;
        if (finished->status.ok()) {
          attempts = {};
        } else {
          failed.push_back(slice);
          if (error.ok()) error = FromGrpcStatus(finished->status);
        }
        under_way.erase(slice);
      }
      queue.Shutdown();
      void* tag = nullptr;
      bool ok = false;
      while (queue.Next(&tag, &ok)) {
      }
      todo.insert(todo.end(), failed.begin(), failed.end());
      if (error.ok()) continue;
      attempts.generation = asked_generation;
      SIGHTLINE_RETURN_IF_ERROR(Recover(error, &attempts));
    }
    return absl::OkStatus();
  }

 private:
  struct NamedMesh {
    const TriangleMesh* mesh;
    std::string name;
  };

  // How far one call has got with trying again since it last got an answer.
  struct Attempts {
    std::optional<std::chrono::steady_clock::time_point> first_unavailable;
    int unavailable = 0;
    int recoveries = 0;
    int generation = 0;
  };

  void Report(double progress, const std::string& message) const {
    if (!created_ && options_.on_progress) options_.on_progress(progress, message);
  }

  void Connect();
  std::shared_ptr<CoverageConnection> connection();

  // OK: a call that failed with `error` may be tried again. Otherwise the error to report.
  absl::Status Recover(absl::Status error, Attempts* attempts);

  // `generation`: the one in which the scene was found missing; the first caller makes it again.
  // UNAVAILABLE: to be tried again, the scene is still missing.
  absl::Status RecreateScene(int generation);

  // In scene_building.cpp, of one attempt each.
  absl::Status CreateScene(CoverageConnection& connection);
  // `name`: PartDigest::Text or PartNameWithMaterials.
  absl::Status UploadPart(CoverageConnection& connection, const std::string& name,
                          const NamedMesh& part);
  // Returns the finished job.
  absl::StatusOr<v1::Job> WaitForJob(CoverageConnection& connection, v1::Job job);
  absl::Status FetchScene(CoverageConnection& connection);
  absl::Status FetchTargets(CoverageConnection& connection);

  const CoverageClientOptions options_;
  const CoverageTask task_;
  std::map<std::string, NamedMesh> meshes_;
  v1::SceneSpec spec_;
  std::mutex connection_mutex_;
  std::shared_ptr<CoverageConnection> connection_;
  // Written by Prepare only.
  SceneInfo info_;
  TargetSet targets_;
  TargetBits measurable_;
  std::vector<uint64_t> measurable_orientations_;
  bool created_ = false;

  std::mutex recovery_mutex_;
  std::atomic<int> generation_ = 0;
  std::atomic<int> recoveries_ = 0;
};

}  // namespace sightline
