// SPDX-License-Identifier: Apache-2.0
#include "planner_client/coverage_client/scene_connection.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/inspection/inspection.h"
#include "core/inspection/vector_proto.h"
#include "core/part/part_digest.h"
#include "core/status/status_macros.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "planner_client/coverage_client/part_upload.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/coverage_service.grpc.pb.h"
#include "sightline/v1/job_service.grpc.pb.h"

namespace sightline {
namespace {

// Number of attempts to create a scene in one call before the server counts as broken (e.g. its
// memory limit is so small that it drops the scene at once).
constexpr int kMaxRecoveriesPerCall = 3;

}  // namespace

SceneConnection::SceneConnection(CoverageClientOptions options, CoverageTask task)
    : options_(std::move(options)), task_(std::move(task)) {
  const std::string part_digest = PartDigestOf(*task_.part).Text();
  info_.part_digest = part_digest;
  const std::string part_name =
      task_.detectability ? PartNameWithMaterials(*task_.part) : part_digest;
  meshes_[part_name] = {task_.part.get(), task_.part_name};
  spec_.set_part_digest(part_name);
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
    const std::string digest = PartDigestOf(*obstacle.mesh).Text();
    meshes_.try_emplace(digest, NamedMesh{obstacle.mesh.get(), obstacle.name});
    v1::SceneObstacle* message = spec_.add_obstacles();
    message->set_part_digest(digest);
    message->set_frame(ObstacleFrameToProto(obstacle.frame));
  }
  spec_.set_field_directions(task_.field_directions);
  if (task_.uncertainty) *spec_.mutable_uncertainty() = UncertaintyToProto(*task_.uncertainty);
  if (task_.domain) *spec_.mutable_measurement() = MeasurementDomainToProto(*task_.domain);
  if (task_.detectability) *spec_.mutable_detectability() = *task_.detectability;
  if (task_.rig.part_placement) {
    const Eigen::AngleAxisd turn(task_.rig.part_placement->rotation);
    v1::PartPlacement& placement = *spec_.mutable_part_placement();
    *placement.mutable_centre_m() = VectorToProto(task_.rig.part_placement->centre_m);
    *placement.mutable_rotation_rad() = VectorToProto(turn.angle() * turn.axis());
  }
  Connect();
}

absl::Status SceneConnection::Prepare() {
  absl::Status status = WithRetries([this](CoverageConnection& connection) {
    // Inside the loop: the server may end while it builds.
    SIGHTLINE_RETURN_IF_ERROR(CreateScene(connection));
    SIGHTLINE_RETURN_IF_ERROR(FetchScene(connection));
    return FetchTargets(connection);
  });
  if (!status.ok()) return status;
  created_ = true;
  return absl::OkStatus();
}

void SceneConnection::Connect() {
  const auto channel = OpenChannel(options_);
  auto connection = std::make_shared<CoverageConnection>();
  connection->coverage = v1::CoverageService::NewStub(channel);
  connection->jobs = v1::JobService::NewStub(channel);
  std::lock_guard lock(connection_mutex_);
  connection_ = std::move(connection);
}

std::shared_ptr<CoverageConnection> SceneConnection::connection() {
  std::lock_guard lock(connection_mutex_);
  return connection_;
}

absl::Status SceneConnection::Recover(absl::Status error, Attempts* attempts) {
  if (ErrorReason(error) == kReasonSceneUnknown) {
    // Prepare makes the scene in every attempt anyway.
    absl::Status made = created_ ? RecreateScene(attempts->generation) : absl::OkStatus();
    if (!absl::IsUnavailable(made)) {
      if (made.ok() && ++attempts->recoveries > kMaxRecoveriesPerCall) return error;
      return made;
    }
    // The new server has ended as well.
    error = made;
  }
  if (!absl::IsUnavailable(error)) return error;
  if (options_.embedded != nullptr) {
    // The connection breaks shortly before the process can be waited for.
    for (int i = 0; i < 10 && options_.embedded->CheckAlive().ok(); ++i) {
      absl::SleepFor(absl::Milliseconds(5));
    }
    std::lock_guard lock(recovery_mutex_);
    if (absl::Status ended = options_.embedded->CheckAlive(); !ended.ok()) {
      SIGHTLINE_RETURN_IF_ERROR(options_.embedded->Restart());
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

absl::Status SceneConnection::WithRetries(
    const std::function<absl::Status(CoverageConnection&)>& call) {
  Attempts attempts;
  while (true) {
    attempts.generation = generation_;
    const std::shared_ptr<CoverageConnection> used = connection();
    absl::Status status = call(*used);
    if (status.ok()) return status;
    if (status = Recover(status, &attempts); !status.ok()) return status;
  }
}

absl::Status SceneConnection::RecreateScene(int generation) {
  std::lock_guard lock(recovery_mutex_);
  if (generation_ != generation) return absl::OkStatus();
  SIGHTLINE_RETURN_IF_ERROR(CreateScene(*connection()));
  ++generation_;
  ++recoveries_;
  return absl::OkStatus();
}

}  // namespace sightline
