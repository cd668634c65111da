// SPDX-License-Identifier: Apache-2.0
// Helpers that the integration tests share: parts, requests, a connection.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "core/part/load_part.h"
#include "core/part/mesh.h"
#include "core/status/status_macros.h"
#include "coverage_server/service/coverage_server.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "planner_client/coverage_client/part_upload.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/coverage_service.grpc.pb.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "tests/limits/wait_until.h"

namespace sightline {

// Closed box of 12 triangles with edges of `size_m`.
inline TriangleMesh MakeBox(const Eigen::Vector3f& size_m) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.positions_m.push_back(
        Eigen::Vector3f(i & 1 ? 1.f : 0.f, i & 2 ? 1.f : 0.f, i & 4 ? 1.f : 0.f)
            .cwiseProduct(size_m));
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

// As LoadPart gives it: vertices in the order of their first use.
inline std::shared_ptr<const TriangleMesh> LoadedBox(const Eigen::Vector3f& size_m) {
  auto mesh = LoadPartFromMemory(EncodePly(MakeBox(size_m)), "ply", "m", "box");
  EXPECT_TRUE(mesh.ok()) << mesh.status();
  return mesh.ok() ? std::make_shared<const TriangleMesh>(*std::move(mesh)) : nullptr;
}

inline v1::Measurement MakeMeasurement(int i) {
  v1::Measurement measurement;
  measurement.set_camera_distance_m(0.3 + 0.001 * (i % 100));
  measurement.set_triangulation_angle_deg(20 + 0.1 * (i % 50));
  measurement.set_camera_azimuth_deg((7 * i) % 360);
  measurement.set_camera_polar_deg(30);
  measurement.set_part_gamma_deg((11 * i) % 340);
  return measurement;
}

inline std::vector<Measurement> Measurements(int count) {
  std::vector<Measurement> measurements;
  for (int i = 0; i < count; ++i) measurements.push_back(MeasurementFromProto(MakeMeasurement(i)));
  return measurements;
}

inline std::vector<int32_t> NewTargets(const std::vector<ScanGain>& gains) {
  std::vector<int32_t> numbers;
  for (const ScanGain& gain : gains) numbers.push_back(gain.new_targets);
  return numbers;
}

class Connection {
 public:
  explicit Connection(const std::string& address) {
    grpc::ChannelArguments arguments;
    arguments.SetMaxReceiveMessageSize(64 << 20);
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
    channel = grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
    coverage = v1::CoverageService::NewStub(channel);
    jobs = v1::JobService::NewStub(channel);
  }

  static void SetTimeout(grpc::ClientContext* context) { context->set_deadline(FarDeadline()); }

  // `declared_size`: of the header; default: the true one.
  absl::Status Upload(const std::string& bytes, const std::string& format, const std::string& unit,
                      v1::UploadPartResponse* response,
                      std::optional<int64_t> declared_size = std::nullopt,
                      size_t chunk_bytes = 100000) {
    grpc::ClientContext context;
    SetTimeout(&context);
    auto writer = coverage->UploadPart(&context, response);
    v1::UploadPartRequest message;
    message.mutable_header()->set_format(format);
    message.mutable_header()->set_unit(unit);
    message.mutable_header()->set_file_name("test." + format);
    message.mutable_header()->set_size_bytes(
        declared_size.value_or(static_cast<int64_t>(bytes.size())));
    bool open = writer->Write(message);
    for (size_t begin = 0; open && begin < bytes.size(); begin += chunk_bytes) {
      message.set_chunk(bytes.substr(begin, chunk_bytes));
      open = writer->Write(message);
    }
    writer->WritesDone();
    return FromGrpcStatus(writer->Finish());
  }

  absl::StatusOr<v1::Job> CreateScene(const v1::SceneSpec& spec,
                                      const std::string& request_id = "") {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::CreateSceneRequest request;
    request.set_request_id(request_id);
    *request.mutable_spec() = spec;
    v1::CreateSceneResponse response;
    SIGHTLINE_RETURN_IF_ERROR(FromGrpcStatus(coverage->CreateScene(&context, request, &response)));
    return response.job();
  }

  // All states until the job's end; `on_state` is called for each.
  absl::StatusOr<std::vector<v1::Job>> Watch(
      const std::string& job_id, const std::function<void()>& on_state = [] {}) {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::WatchJobRequest request;
    request.set_job_id(job_id);
    auto reader = jobs->WatchJob(&context, request);
    std::vector<v1::Job> states;
    v1::WatchJobResponse response;
    while (reader->Read(&response)) {
      states.push_back(response.job());
      on_state();
    }
    SIGHTLINE_RETURN_IF_ERROR(FromGrpcStatus(reader->Finish()));
    return states;
  }

  // Uploads a box and builds its scene; returns the scene's digest.
  std::string MakeScene(const Eigen::Vector3f& size_m = {0.1f, 0.2f, 0.3f}, int64_t seed = 1) {
    return MakeScene(UploadBox(size_m, seed));
  }

  // The spec of a box's scene; the box is uploaded.
  v1::SceneSpec UploadBox(const Eigen::Vector3f& size_m = {0.1f, 0.2f, 0.3f}, int64_t seed = 1) {
    v1::UploadPartResponse uploaded;
    absl::Status status = Upload(EncodePly(MakeBox(size_m)), "ply", "m", &uploaded);
    EXPECT_TRUE(status.ok()) << status;
    v1::SceneSpec spec;
    spec.set_part_digest(uploaded.part_digest());
    spec.mutable_targets()->set_seed(seed);
    return spec;
  }

  std::string MakeScene(const v1::SceneSpec& spec) {
    absl::StatusOr<v1::Job> job = CreateScene(spec);
    EXPECT_TRUE(job.ok()) << job.status();
    if (!job.ok()) return "";
    absl::StatusOr<std::vector<v1::Job>> states = Watch(job->job_id());
    EXPECT_TRUE(states.ok()) << states.status();
    if (!states.ok() || states->empty()) return "";
    EXPECT_EQ(states->back().state(), v1::Job::STATE_SUCCEEDED) << states->back().DebugString();
    return states->back().result_key();
  }

  absl::Status Gains(const v1::EvaluateGainsRequest& request, v1::EvaluateGainsResponse* response,
                     std::chrono::system_clock::time_point deadline = FarDeadline()) {
    grpc::ClientContext context;
    context.set_deadline(deadline);
    return FromGrpcStatus(coverage->EvaluateGains(&context, request, response));
  }

  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::CoverageService::Stub> coverage;
  std::unique_ptr<v1::JobService::Stub> jobs;
};

inline v1::EvaluateGainsRequest GainsRequest(const std::string& scene_digest, int count,
                                             v1::Evaluator evaluator = v1::EVALUATOR_FAST) {
  v1::EvaluateGainsRequest request;
  request.set_scene_digest(scene_digest);
  request.set_evaluator(evaluator);
  for (int i = 0; i < count; ++i) *request.add_measurements() = MakeMeasurement(i);
  return request;
}

// Folder with a short path, for sockets.
class TemporaryFolder {
 public:
  TemporaryFolder() { EXPECT_NE(mkdtemp(path_.data()), nullptr); }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_ = "/tmp/sightline-test-XXXXXX";
};

}  // namespace sightline
