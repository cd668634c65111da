#include "planner_client/coverage_client/coverage_client.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "planner_client/coverage_client/part_upload.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/coverage_service.grpc.pb.h"
#include "sightline/v1/job_service.grpc.pb.h"

namespace sightline {
namespace {

constexpr int64_t kMaxCoverageBytesPerRequest = 8 << 20;
// Some seconds' work, so that every request stays far below its deadline.
constexpr size_t kExplanationsPerRequest = 2048;
constexpr absl::Duration kShortTimeout = absl::Seconds(20);
// How often a scene is created again in one call before the server is called broken (e.g. its
// memory limit is so small that it drops the scene at once).
constexpr int kMaxRecoveriesPerCall = 3;

absl::StatusOr<ScanFeasibility> FeasibilityFromProto(v1::Feasibility feasibility) {
  switch (feasibility) {
    case v1::FEASIBILITY_FEASIBLE:
      return ScanFeasibility::kFeasible;
    case v1::FEASIBILITY_COLLISION:
      return ScanFeasibility::kCollision;
    case v1::FEASIBILITY_TRAVEL:
      return ScanFeasibility::kTravel;
    case v1::FEASIBILITY_OUT_OF_BOUNDS:
      return ScanFeasibility::kOutOfBounds;
    default:
      return absl::InternalError(
          absl::StrCat("server answered an unknown feasibility ", feasibility));
  }
}

Eigen::Vector3d VectorFromProto(const v1::Vector3& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

v1::Vector3 VectorToProto(const Eigen::Vector3d& vector) {
  v1::Vector3 message;
  message.set_x(vector.x());
  message.set_y(vector.y());
  message.set_z(vector.z());
  return message;
}

Eigen::Vector3f VectorAt(const google::protobuf::RepeatedField<float>& field, int i) {
  return {field[3 * i], field[3 * i + 1], field[3 * i + 2]};
}

// Measurements [begin, end) of a call.
struct Slice {
  size_t begin;
  size_t end;
};

std::vector<Slice> Cut(size_t count, size_t batch) {
  std::vector<Slice> slices;
  for (size_t begin = 0; begin < count; begin += batch) {
    slices.push_back({begin, std::min(count, begin + batch)});
  }
  return slices;
}

// One connection; replaced after a restart of the server.
struct Connection {
  std::unique_ptr<v1::CoverageService::Stub> coverage;
  std::unique_ptr<v1::JobService::Stub> jobs;
};

class CoverageClientImpl final : public CoverageClient {
 public:
  CoverageClientImpl(CoverageClientOptions options, CoverageTask task)
      : options_(std::move(options)), task_(std::move(task)) {
    const std::string part_digest = PartDigest(*task_.part);
    info_.part_digest = part_digest;
    meshes_[part_digest] = {task_.part.get(), task_.part_name};
    spec_.set_part_digest(part_digest);
    *spec_.mutable_camera() = CameraToProto(task_.rig.camera);
    if (task_.rig.lens) {
      spec_.mutable_lens()->set_focal_length_m(task_.rig.lens->focal_length_m);
      spec_.mutable_lens()->set_f_number(task_.rig.lens->f_number);
      if (task_.rig.lens->focus_distance_m) {
        spec_.mutable_lens()->set_focus_distance_m(*task_.rig.lens->focus_distance_m);
      }
    }
    *spec_.mutable_laser() = LaserToProto(task_.rig.laser);
    *spec_.mutable_rig() = RigToProto(task_.rig);
    *spec_.mutable_targets() = TargetSamplingToProto(task_.sampling);
    for (const CoverageTask::Obstacle& obstacle : task_.obstacles) {
      const std::string digest = PartDigest(*obstacle.mesh);
      meshes_.try_emplace(digest, NamedMesh{obstacle.mesh.get(), obstacle.name});
      v1::SceneObstacle* message = spec_.add_obstacles();
      message->set_part_digest(digest);
      message->set_frame(ObstacleFrameToProto(obstacle.frame));
    }
    spec_.set_field_directions(task_.field_directions);
    if (task_.uncertainty) *spec_.mutable_uncertainty() = UncertaintyToProto(*task_.uncertainty);
    if (task_.domain) *spec_.mutable_measurement() = MeasurementDomainToProto(*task_.domain);
    if (task_.rig.part_placement) {
      const Eigen::AngleAxisd turn(task_.rig.part_placement->rotation);
      v1::PartPlacement& placement = *spec_.mutable_part_placement();
      *placement.mutable_centre_m() = VectorToProto(task_.rig.part_placement->centre_m);
      *placement.mutable_rotation_rad() = VectorToProto(turn.angle() * turn.axis());
    }
    Connect();
  }

  absl::Status Prepare() {
    absl::Status status = WithRetries([this](Connection& connection) {
      // Inside the loop: the server may end while it builds.
      if (absl::Status built = CreateScene(connection); !built.ok()) return built;
      if (absl::Status got = FetchScene(connection); !got.ok()) return got;
      return FetchTargets(connection);
    });
    if (!status.ok()) return status;
    created_ = true;
    return absl::OkStatus();
  }

  const SceneInfo& scene() const override { return info_; }
  const TargetSet& targets() const override { return targets_; }
  const TargetBits& measurable() const override { return measurable_; }
  int64_t evaluations() const override { return evaluations_; }
  int recoveries() const override { return recoveries_; }

  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override {
    return GainsOf(measurements, [&](v1::EvaluateGainsRequest* request) {
      request->set_covered_targets(Settled(measurable_, known).ToBytes());
    });
  }

  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override {
    return GainsOf(measurements, [&](v1::EvaluateGainsRequest* request) {
      request->mutable_target_weights()->Add(weights.begin(), weights.end());
    });
  }

  absl::StatusOr<std::vector<ScanGain>> UncertaintyGains(std::span<const Measurement> measurements,
                                                         const UncertaintyQuery& query,
                                                         std::span<const float> known_density,
                                                         std::span<const float> weights) override {
    return GainsOf(
        measurements,
        [&](v1::EvaluateGainsRequest* request) {
          v1::UncertaintyGain& gain = *request->mutable_uncertainty_gain();
          gain.mutable_weights()->set_coverage(query.weights.coverage);
          gain.mutable_weights()->set_admissible(query.weights.admissible);
          gain.mutable_weights()->set_relaxed(query.weights.relaxed);
          gain.mutable_weights()->set_information(query.weights.information);
          gain.mutable_weights()->set_total_uncertainty(query.weights.total_uncertainty);
          gain.mutable_admissible_uncertainty_m()->Add(query.admissible_uncertainty_m.begin(),
                                                       query.admissible_uncertainty_m.end());
          gain.set_relaxed_uncertainty_m(query.relaxed_uncertainty_m);
          if (query.covered.size() > 0) request->set_covered_targets(query.covered.ToBytes());
          gain.mutable_known_information_per_m4()->Add(known_density.begin(), known_density.end());
          request->mutable_target_weights()->Add(weights.begin(), weights.end());
        },
        true);
  }

  absl::StatusOr<std::vector<InformedScan>> FastInformation(
      std::span<const Measurement> measurements) override {
    std::vector<InformedScan> result;
    result.reserve(measurements.size());
    absl::Status status = AskCoverage(
        measurements, v1::EVALUATOR_FAST, FastBatch(measurements.size()),
        [&](ScanFeasibility feasibility, const v1::Coverage& message) -> absl::Status {
          if (message.informed_targets_size() != message.information_per_m4_size()) {
            return absl::InternalError("server answered information of unequal length");
          }
          for (const uint32_t target : message.informed_targets()) {
            if (target >= targets_.size()) {
              return absl::InternalError("server answered information of an unknown target");
            }
          }
          InformedScan& scan = result.emplace_back();
          scan.feasibility = feasibility;
          scan.covered = TargetBits::FromBytes(targets_.size(), message.covered_targets());
          scan.covered &= measurable_;
          scan.targets.assign(message.informed_targets().begin(), message.informed_targets().end());
          scan.density.assign(message.information_per_m4().begin(),
                              message.information_per_m4().end());
          return absl::OkStatus();
        });
    if (!status.ok()) return status;
    evaluations_ += static_cast<int64_t>(measurements.size());
    return result;
  }

  absl::StatusOr<PosteriorUncertainties> Uncertainties(std::span<const Measurement> scans,
                                                       std::span<const uint32_t> targets,
                                                       bool after_each_scan,
                                                       std::span<const float> enough_m) override {
    const size_t count = targets.empty() ? targets_.size() : targets.size();
    // What is asked after an interruption is for the plan that is kept.
    const bool kept = options_.interrupted != nullptr && *options_.interrupted;
    PosteriorUncertainties result;
    absl::Status status = WithRetries([&](Connection& connection) -> absl::Status {
      result = {};
      grpc::ClientContext context;
      SetTimeout(&context, options_.build_timeout);
      v1::EvaluateUncertaintyRequest request;
      request.set_scene_digest(info_.scene_digest);
      for (const Measurement& scan : scans) *request.add_measurements() = MeasurementToProto(scan);
      request.mutable_targets()->Add(targets.begin(), targets.end());
      request.set_after_each_scan(after_each_scan);
      request.mutable_enough_m()->Add(enough_m.begin(), enough_m.end());
      auto reader = connection.coverage->EvaluateUncertainty(&context, request);
      v1::EvaluateUncertaintyResponse response;
      while (reader->Read(&response)) {
        const auto append = [](const auto& from, auto& to) {
          to.insert(to.end(), from.begin(), from.end());
        };
        append(response.uncertainty_m(), result.total_m);
        append(response.noise_m(), result.noise_m);
        append(response.sampling_m(), result.sampling_m);
        append(response.calibration_m(), result.calibration_m);
        append(response.points(), result.points);
        append(response.after_each_scan_m(), result.after_each_scan_m);
        if (!kept && options_.interrupted != nullptr && *options_.interrupted) context.TryCancel();
      }
      return FromGrpcStatus(reader->Finish());
    });
    if (!status.ok()) return status;
    if (result.total_m.size() != count || result.noise_m.size() != count ||
        result.sampling_m.size() != count || result.calibration_m.size() != count ||
        result.points.size() != count ||
        result.after_each_scan_m.size() != (after_each_scan ? count * scans.size() : 0)) {
      return absl::InternalError("server answered another number of uncertainties than asked");
    }
    return result;
  }

  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override {
    auto coverages = CoverageOf(measurements, v1::EVALUATOR_FAST, FastBatch(measurements.size()));
    if (coverages.ok()) evaluations_ += static_cast<int64_t>(measurements.size());
    return coverages;
  }

  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override {
    // Slow queries: one each keeps all cores of the server busy.
    return CoverageOf(measurements, v1::EVALUATOR_EXACT, 1);
  }

  absl::StatusOr<std::vector<ScanPoint>> MeasurementPoints(
      const Measurement& measurement) override {
    std::vector<ScanPoint> points;
    absl::Status status = WithRetries([&](Connection& connection) -> absl::Status {
      points.clear();
      grpc::ClientContext context;
      SetTimeout(&context, options_.query_timeout);
      v1::StreamMeasurementPointsRequest request;
      request.set_scene_digest(info_.scene_digest);
      *request.mutable_measurement() = MeasurementToProto(measurement);
      auto reader = connection.coverage->StreamMeasurementPoints(&context, request);
      v1::StreamMeasurementPointsResponse response;
      while (reader->Read(&response)) {
        const int count = response.frames_size();
        if (response.positions_m_size() != 3 * count || response.normals_size() != 3 * count ||
            response.columns_px_size() != count) {
          context.TryCancel();
          return absl::InternalError("server answered measurement points of unequal length");
        }
        for (int i = 0; i < count; ++i) {
          points.push_back({VectorAt(response.positions_m(), i), VectorAt(response.normals(), i),
                            response.frames(i), response.columns_px(i)});
        }
      }
      return FromGrpcStatus(reader->Finish());
    });
    if (!status.ok()) return status;
    return points;
  }

  absl::StatusOr<std::vector<TargetReason>> ExplainTargets(
      std::span<const uint32_t> targets) override {
    const std::vector<Slice> slices = Cut(targets.size(), kExplanationsPerRequest);
    std::vector<v1::ExplainTargetsResponse> responses;
    absl::Status status = Pipeline<v1::ExplainTargetsRequest, v1::ExplainTargetsResponse>(
        slices,
        [&](const Slice& slice, v1::ExplainTargetsRequest* request) {
          request->set_scene_digest(info_.scene_digest);
          request->mutable_targets()->Add(targets.begin() + slice.begin,
                                          targets.begin() + slice.end);
        },
        &v1::CoverageService::Stub::AsyncExplainTargets, &responses);
    if (!status.ok()) return status;
    std::vector<TargetReason> reasons;
    reasons.reserve(targets.size());
    for (size_t s = 0; s < slices.size(); ++s) {
      if (static_cast<size_t>(responses[s].explanations_size()) !=
          slices[s].end - slices[s].begin) {
        return absl::InternalError("server answered another number of explanations than asked");
      }
      for (const auto& explanation : responses[s].explanations()) {
        const bool named = explanation.reason() == v1::UNCOVERED_REASON_OBSTACLE;
        if (!v1::UncoveredReason_IsValid(explanation.reason()) ||
            explanation.reason() == v1::UNCOVERED_REASON_UNSPECIFIED ||
            (named &&
             (explanation.obstacle() < 0 || explanation.obstacle() >= spec_.obstacles_size()))) {
          return absl::InternalError("server answered an unknown reason or obstacle");
        }
        reasons.push_back({explanation.reason(), named ? explanation.obstacle() : -1});
      }
    }
    return reasons;
  }

  absl::StatusOr<std::string> RenderView(v1::RenderViewRequest request) override {
    request.set_scene_digest(info_.scene_digest);
    v1::RenderViewResponse response;
    absl::Status status = WithRetries([&](Connection& connection) {
      grpc::ClientContext context;
      SetTimeout(&context, options_.query_timeout);
      return FromGrpcStatus(connection.coverage->RenderView(&context, request, &response));
    });
    if (!status.ok()) return status;
    return std::move(*response.mutable_png());
  }

 private:
  struct NamedMesh {
    const TriangleMesh* mesh;
    std::string name;
  };

  void Report(double progress, const std::string& message) const {
    if (!created_ && options_.on_progress) options_.on_progress(progress, message);
  }

  void Connect() {
    const auto channel = OpenChannel(options_);
    auto connection = std::make_shared<Connection>();
    connection->coverage = v1::CoverageService::NewStub(channel);
    connection->jobs = v1::JobService::NewStub(channel);
    std::lock_guard lock(connection_mutex_);
    connection_ = std::move(connection);
  }

  std::shared_ptr<Connection> connection() {
    std::lock_guard lock(connection_mutex_);
    return connection_;
  }

  // How far one call has got with trying again since it last got an answer.
  struct Attempts {
    std::optional<std::chrono::steady_clock::time_point> first_unavailable;
    int unavailable = 0;
    int recoveries = 0;
    int generation = 0;
  };

  // OK: what failed with `error` may be tried again. Otherwise the error to report.
  absl::Status Recover(absl::Status error, Attempts* attempts) {
    if (ErrorReason(error) == kReasonSceneUnknown) {
      // Prepare makes the scene in every attempt anyway.
      absl::Status made = created_ ? RecreateScene(attempts->generation) : absl::OkStatus();
      if (!absl::IsUnavailable(made)) {
        if (made.ok() && ++attempts->recoveries > kMaxRecoveriesPerCall) return error;
        return made;
      }
      // Nor that server is there any more.
      error = made;
    }
    if (!absl::IsUnavailable(error)) return error;
    if (options_.embedded != nullptr) {
      // The connection breaks a moment before the process can be waited for.
      for (int i = 0; i < 10 && options_.embedded->CheckAlive().ok(); ++i) {
        absl::SleepFor(absl::Milliseconds(5));
      }
      std::lock_guard lock(recovery_mutex_);
      if (absl::Status ended = options_.embedded->CheckAlive(); !ended.ok()) {
        if (absl::Status status = options_.embedded->Restart(); !status.ok()) return status;
        Connect();
        return absl::OkStatus();
      }
    }
    const auto now = std::chrono::steady_clock::now();
    if (!attempts->first_unavailable) attempts->first_unavailable = now;
    if (absl::FromChrono(now - *attempts->first_unavailable) > options_.retry_for) {
      return absl::UnavailableError(absl::StrCat("coverage server ", options_.Address(), ": ",
                                                 error.message(), " (tried ",
                                                 attempts->unavailable + 1, " times)"));
    }
    const absl::Duration pause = RetryPause(attempts->unavailable++);
    absl::SleepFor(std::max(
        pause, std::min(RetryDelay(error).value_or(absl::ZeroDuration()), absl::Seconds(5))));
    return absl::OkStatus();
  }

  absl::Status WithRetries(const std::function<absl::Status(Connection&)>& call) {
    Attempts attempts;
    while (true) {
      attempts.generation = generation_;
      const std::shared_ptr<Connection> used = connection();
      absl::Status status = call(*used);
      if (status.ok()) return status;
      if (status = Recover(status, &attempts); !status.ok()) return status;
    }
  }

  // `generation`: the one in which the scene was found missing; whoever comes first makes it again.
  // UNAVAILABLE: to be tried again, the scene is still missing.
  absl::Status RecreateScene(int generation) {
    std::lock_guard lock(recovery_mutex_);
    if (generation_ != generation) return absl::OkStatus();
    if (absl::Status status = CreateScene(*connection()); !status.ok()) return status;
    ++generation_;
    ++recoveries_;
    return absl::OkStatus();
  }

  absl::Status CreateScene(Connection& connection) {
    // Every part may be missing once, plus one round for a scene dropped in between.
    const int max_rounds = static_cast<int>(meshes_.size()) + 2;
    for (int round = 0; round < max_rounds; ++round) {
      v1::CreateSceneRequest request;
      request.set_request_id(NewRequestId());
      *request.mutable_spec() = spec_;
      v1::CreateSceneResponse response;
      grpc::ClientContext context;
      SetTimeout(&context, kShortTimeout);
      absl::Status status =
          FromGrpcStatus(connection.coverage->CreateScene(&context, request, &response));
      if (ErrorReason(status) == kReasonPartUnknown) {
        const auto metadata = ErrorMetadata(status);
        const auto digest = metadata.find("part_digest");
        const auto mesh = digest == metadata.end() ? meshes_.end() : meshes_.find(digest->second);
        if (mesh == meshes_.end()) return status;
        status = UploadPart(connection, mesh->first, mesh->second);
        if (!status.ok()) return status;
        continue;
      }
      if (!status.ok()) return status;
      absl::StatusOr<v1::Job> job = WaitForJob(connection, response.job());
      if (!job.ok()) return job.status();
      switch (job->state()) {
        case v1::Job::STATE_SUCCEEDED:
          if (created_ && job->result_key() != info_.scene_digest) {
            return absl::InternalError(
                "the server made another scene than before: is it another version?");
          }
          if (!created_) info_.scene_digest = job->result_key();
          return absl::OkStatus();
        case v1::Job::STATE_FAILED:
          // A part that was dropped for lack of memory while the job waited.
          if (job->error_code() == static_cast<int>(absl::StatusCode::kNotFound)) continue;
          return absl::Status(static_cast<absl::StatusCode>(job->error_code()),
                              absl::StrCat("building the scene: ", job->error_message()));
        default:
          return absl::CancelledError("building the scene was cancelled");
      }
    }
    return absl::ResourceExhaustedError(
        "the server forgets parts as fast as they are uploaded: its part store is too small");
  }

  absl::Status UploadPart(Connection& connection, const std::string& digest,
                          const NamedMesh& part) {
    Report(0, absl::StrCat("uploading ", part.name));
    const std::string bytes = EncodePly(*part.mesh);
    v1::UploadPartResponse response;
    grpc::ClientContext context;
    SetTimeout(&context, UploadTimeout(bytes.size()));
    auto writer = connection.coverage->UploadPart(&context, &response);
    v1::UploadPartRequest message;
    message.mutable_header()->set_format("ply");
    message.mutable_header()->set_unit("m");
    message.mutable_header()->set_size_bytes(static_cast<int64_t>(bytes.size()));
    message.mutable_header()->set_file_name(part.name);
    WriteUpload(*writer, std::move(message), bytes);
    absl::Status status = FromGrpcStatus(writer->Finish());
    if (!status.ok()) return status;
    if (response.part_digest() != digest) {
      return absl::InternalError(
          absl::StrCat("the server read ", part.name, " differently: is it another version?"));
    }
    return absl::OkStatus();
  }

  // Returns the finished job.
  absl::StatusOr<v1::Job> WaitForJob(Connection& connection, v1::Job job) {
    const auto finished = [](const v1::Job& j) { return j.state() >= v1::Job::STATE_SUCCEEDED; };
    const auto report = [this](const v1::Job& j) { Report(j.progress(), j.message()); };
    report(job);
    if (finished(job)) return job;
    grpc::ClientContext context;
    SetTimeout(&context, options_.build_timeout);
    std::atomic<bool> done = false;
    std::thread interrupter;
    if (options_.interrupted != nullptr) {
      interrupter = std::thread([&] {
        while (!done) {
          if (*options_.interrupted) {
            context.TryCancel();
            return;
          }
          absl::SleepFor(absl::Milliseconds(20));
        }
      });
    }
    v1::WatchJobRequest request;
    request.set_job_id(job.job_id());
    auto reader = connection.jobs->WatchJob(&context, request);
    v1::WatchJobResponse response;
    while (reader->Read(&response)) {
      job = response.job();
      report(job);
    }
    absl::Status status = FromGrpcStatus(reader->Finish());
    done = true;
    if (interrupter.joinable()) interrupter.join();
    if (status.ok() && finished(job)) return job;
    if (options_.interrupted != nullptr && *options_.interrupted) {
      status = absl::CancelledError("interrupted while the scene was being built");
    } else if (status.ok()) {
      return absl::InternalError("the server stopped reporting on a job before its end");
    }
    if (!absl::IsUnavailable(status)) {
      // Nobody waits for it any more.
      grpc::ClientContext cancel_context;
      SetTimeout(&cancel_context, absl::Seconds(2));
      v1::CancelJobRequest cancel;
      cancel.set_job_id(job.job_id());
      v1::CancelJobResponse ignored;
      connection.jobs->CancelJob(&cancel_context, cancel, &ignored);
    }
    return status;
  }

  absl::Status FetchScene(Connection& connection) {
    v1::GetSceneRequest request;
    request.set_scene_digest(info_.scene_digest);
    v1::GetSceneResponse response;
    grpc::ClientContext context;
    SetTimeout(&context, kShortTimeout);
    absl::Status status =
        FromGrpcStatus(connection.coverage->GetScene(&context, request, &response));
    if (!status.ok()) return status;
    info_.spec = response.spec();
    info_.target_count = response.target_count();
    info_.measurable_count = response.measurable_count();
    info_.measurable_in_free_space_count = response.measurable_in_free_space_count();
    info_.part_centre_m = VectorFromProto(response.part_centre_m());
    info_.part_size_m = VectorFromProto(response.part_size_m());
    info_.field_bytes = response.field_bytes();
    info_.targets_time_s = response.targets_time_s();
    info_.field_time_s = response.field_time_s();
    info_.measurability_time_s = response.measurability_time_s();
    return absl::OkStatus();
  }

  absl::Status FetchTargets(Connection& connection) {
    targets_ = {};
    measurable_ = TargetBits(static_cast<size_t>(info_.target_count));
    grpc::ClientContext context;
    SetTimeout(&context, options_.query_timeout);
    v1::StreamTargetsRequest request;
    request.set_scene_digest(info_.scene_digest);
    auto reader = connection.coverage->StreamTargets(&context, request);
    v1::StreamTargetsResponse response;
    while (reader->Read(&response)) {
      const int count = response.regions_size();
      if (response.positions_m_size() != 3 * count || response.normals_size() != 3 * count ||
          response.measurable_size() != count ||
          static_cast<int64_t>(targets_.size()) + count > info_.target_count) {
        context.TryCancel();
        return absl::InternalError("server answered targets of unequal length");
      }
      for (int i = 0; i < count; ++i) {
        if (response.measurable(i)) measurable_.Set(targets_.size());
        targets_.positions_m.push_back(VectorAt(response.positions_m(), i));
        targets_.normals.push_back(VectorAt(response.normals(), i));
        targets_.regions.push_back(response.regions(i));
      }
    }
    absl::Status status = FromGrpcStatus(reader->Finish());
    if (status.ok() && static_cast<int64_t>(targets_.size()) != info_.target_count) {
      return absl::InternalError("server answered too few targets");
    }
    return status;
  }

  // Enough requests to keep the server busy, each long enough to be worth its overhead.
  size_t FastBatch(size_t count) const {
    const size_t share = count / static_cast<size_t>(std::max(1, options_.outstanding_requests));
    return std::clamp(share, static_cast<size_t>(options_.min_batch),
                      static_cast<size_t>(options_.max_batch));
  }

  // Sends one request per slice, several at a time, and tries again those that failed for a reason
  // that passes. `fill` makes the request of a slice; `method` is a unary call of the asynchronous
  // stub; responses[i] answers slices[i]. All runs on the calling thread. Not gRPC's callback
  // interface: in 1.51 the threads behind it abort the process when its last channel is destroyed
  // soon after a call (ref_counted.h: prior > 0).
  template <typename Request, typename Response>
  absl::Status Pipeline(const std::vector<Slice>& slices,
                        const std::function<void(const Slice&, Request*)>& fill,
                        std::unique_ptr<grpc::ClientAsyncResponseReader<Response>> (
                            v1::CoverageService::Stub::*method)(grpc::ClientContext*,
                                                                const Request&,
                                                                grpc::CompletionQueue*),
                        std::vector<Response>* responses) {
    struct Pending {
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
      const std::shared_ptr<Connection> used = connection();
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
          Request request;
          fill(slices[slice], &request);
          SetTimeout(&pending.context, options_.query_timeout);
          pending.reader = (used->coverage.get()->*method)(&pending.context, request, &queue);
          pending.reader->Finish(&(*responses)[slice], &pending.status,
                                 reinterpret_cast<void*>(slice));
          continue;
        }
        void* tag = nullptr;
        bool ok = false;
        queue.Next(&tag, &ok);
        const auto finished = under_way.find(reinterpret_cast<size_t>(tag));
        if (finished->second.status.ok()) {
          attempts = {};
        } else {
          failed.push_back(finished->first);
          if (error.ok()) error = FromGrpcStatus(finished->second.status);
        }
        under_way.erase(finished);
      }
      queue.Shutdown();
      void* tag = nullptr;
      bool ok = false;
      while (queue.Next(&tag, &ok)) {
      }
      todo.insert(todo.end(), failed.begin(), failed.end());
      if (error.ok()) continue;
      attempts.generation = asked_generation;
      if (absl::Status status = Recover(error, &attempts); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  // `complete` adds to every request what it asks about the measurements.
  absl::StatusOr<std::vector<ScanGain>> GainsOf(
      std::span<const Measurement> measurements,
      const std::function<void(v1::EvaluateGainsRequest*)>& complete, bool by_uncertainty = false) {
    const std::vector<Slice> slices = Cut(measurements.size(), FastBatch(measurements.size()));
    std::vector<v1::EvaluateGainsResponse> responses;
    absl::Status status = Pipeline<v1::EvaluateGainsRequest, v1::EvaluateGainsResponse>(
        slices,
        [&](const Slice& slice, v1::EvaluateGainsRequest* request) {
          request->set_scene_digest(info_.scene_digest);
          request->set_evaluator(v1::EVALUATOR_FAST);
          for (size_t i = slice.begin; i < slice.end; ++i) {
            *request->add_measurements() = MeasurementToProto(measurements[i]);
          }
          complete(request);
        },
        &v1::CoverageService::Stub::AsyncEvaluateGains, &responses);
    if (!status.ok()) return status;
    std::vector<ScanGain> gains;
    gains.reserve(measurements.size());
    for (size_t s = 0; s < slices.size(); ++s) {
      if (static_cast<size_t>(responses[s].gains_size()) != slices[s].end - slices[s].begin) {
        return absl::InternalError("server answered another number of gains than asked");
      }
      for (const v1::Gain& gain : responses[s].gains()) {
        absl::StatusOr<ScanFeasibility> feasibility = FeasibilityFromProto(gain.feasibility());
        if (!feasibility.ok()) return feasibility.status();
        // Without an uncertainty gain what counts is covered targets.
        gains.push_back({*feasibility, gain.new_targets(), gain.covered_targets(),
                         gain.weighted_gain(), by_uncertainty ? gain.gain() : gain.new_targets()});
      }
    }
    evaluations_ += static_cast<int64_t>(measurements.size());
    return gains;
  }

  // Calls take(feasibility, answer) for every measurement, in order.
  absl::Status AskCoverage(
      std::span<const Measurement> measurements, v1::Evaluator evaluator, size_t batch,
      const std::function<absl::Status(ScanFeasibility, const v1::Coverage&)>& take) {
    const bool informed = evaluator == v1::EVALUATOR_FAST && task_.uncertainty;
    const int64_t bytes_each =
        info_.target_count / 4 + 64 + (informed ? 8 * info_.target_count : 0);
    batch = std::min(
        batch, static_cast<size_t>(std::max<int64_t>(1, kMaxCoverageBytesPerRequest / bytes_each)));
    const std::vector<Slice> slices = Cut(measurements.size(), batch);
    std::vector<v1::EvaluateCoverageResponse> responses;
    absl::Status status = Pipeline<v1::EvaluateCoverageRequest, v1::EvaluateCoverageResponse>(
        slices,
        [&](const Slice& slice, v1::EvaluateCoverageRequest* request) {
          request->set_scene_digest(info_.scene_digest);
          request->set_evaluator(evaluator);
          for (size_t i = slice.begin; i < slice.end; ++i) {
            *request->add_measurements() = MeasurementToProto(measurements[i]);
          }
        },
        &v1::CoverageService::Stub::AsyncEvaluateCoverage, &responses);
    if (!status.ok()) return status;
    for (size_t s = 0; s < slices.size(); ++s) {
      if (static_cast<size_t>(responses[s].coverages_size()) != slices[s].end - slices[s].begin) {
        return absl::InternalError("server answered another number of coverages than asked");
      }
      for (const v1::Coverage& message : responses[s].coverages()) {
        absl::StatusOr<ScanFeasibility> feasibility = FeasibilityFromProto(message.feasibility());
        if (!feasibility.ok()) return feasibility.status();
        if (status = take(*feasibility, message); !status.ok()) return status;
      }
    }
    return absl::OkStatus();
  }

  absl::StatusOr<std::vector<ScanCoverage>> CoverageOf(std::span<const Measurement> measurements,
                                                       v1::Evaluator evaluator, size_t batch) {
    std::vector<ScanCoverage> coverages;
    coverages.reserve(measurements.size());
    const size_t target_count = targets_.size();
    absl::Status status = AskCoverage(
        measurements, evaluator, batch,
        [&](ScanFeasibility feasibility, const v1::Coverage& message) -> absl::Status {
          ScanCoverage coverage;
          coverage.feasibility = feasibility;
          coverage.covered = TargetBits::FromBytes(target_count, message.covered_targets());
          coverage.covered &= measurable_;
          if (evaluator == v1::EVALUATOR_EXACT) {
            coverage.covered_without_normal_gate =
                TargetBits::FromBytes(target_count, message.covered_targets_without_normal_gate());
            coverage.covered_without_normal_gate &= measurable_;
            coverage.first_frame = message.first_frame();
            coverage.last_frame = message.last_frame();
            coverage.measurement_points = message.measurement_points();
          }
          coverages.push_back(std::move(coverage));
          return absl::OkStatus();
        });
    if (!status.ok()) return status;
    return coverages;
  }

  const CoverageClientOptions options_;
  const CoverageTask task_;
  std::map<std::string, NamedMesh> meshes_;
  v1::SceneSpec spec_;
  std::mutex connection_mutex_;
  std::shared_ptr<Connection> connection_;
  // Written by Prepare only.
  SceneInfo info_;
  TargetSet targets_;
  TargetBits measurable_;
  bool created_ = false;

  std::mutex recovery_mutex_;
  std::atomic<int> generation_ = 0;
  std::atomic<int> recoveries_ = 0;
  std::atomic<int64_t> evaluations_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CoverageClient>> CoverageClient::Open(CoverageClientOptions options,
                                                                     CoverageTask task) {
  if (task.part == nullptr) return absl::InvalidArgumentError("a coverage task needs a part");
  auto client = std::make_unique<CoverageClientImpl>(std::move(options), std::move(task));
  if (absl::Status status = client->Prepare(); !status.ok()) return status;
  return client;
}

}  // namespace sightline
