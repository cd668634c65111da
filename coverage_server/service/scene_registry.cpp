// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/service/scene_registry.h"

#include <spdlog/spdlog.h>

#include "absl/strings/str_cat.h"
#include "core/part/part_digest.h"
#include "core/status/status_macros.h"
#include "core/text/printable.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

constexpr size_t kMaxRequestIdBytes = 128;
constexpr size_t kRememberedRequests = 10000;

int64_t MeshBytes(const TriangleMesh& mesh) {
  return static_cast<int64_t>(mesh.positions_m.size() * sizeof(mesh.positions_m[0]) +
                              mesh.triangles.size() * sizeof(mesh.triangles[0]) +
                              mesh.triangle_material.size() * sizeof(uint16_t));
}

int64_t SceneBytes(const CoverageScene& scene) {
  const TargetSet& targets = scene.targets();
  int64_t bytes =
      scene.field_bytes() + MeshBytes(scene.part()) +
      static_cast<int64_t>(targets.size() * (2 * sizeof(Eigen::Vector3f) + 2 * sizeof(int32_t)));
  for (const SceneObstacle& obstacle : scene.obstacles()) bytes += MeshBytes(obstacle.mesh);
  return bytes;
}

// Forgets the oldest entries of a map whose keys were added in `order`.
template <typename Map>
void Trim(Map* map, std::deque<std::string>* order) {
  while (order->size() > kRememberedRequests) {
    map->erase(order->front());
    order->pop_front();
  }
}

}  // namespace

SceneRegistry::SceneRegistry(CoverageBackend backend, JobStore* jobs, CoverageMetrics* metrics,
                             int64_t max_part_bytes, int64_t max_scene_bytes)
    : backend_(std::move(backend)),
      jobs_(jobs),
      metrics_(metrics),
      parts_(max_part_bytes),
      scenes_(max_scene_bytes),
      measured_scans_(std::make_shared<LruStore<MeasuredScans::Points>>(kMeasuredScansBytes)) {}

absl::StatusOr<std::string> SceneRegistry::AddPart(std::shared_ptr<const StoredPart> part) {
  const std::string digest = PartDigestOf(part->mesh).Text();
  const int64_t bytes = MeshBytes(part->mesh);
  std::vector<std::string> names = {digest};
  if (!part->mesh.triangle_material.empty()) names.push_back(PartNameWithMaterials(part->mesh));
  for (const std::string& name : names) {
    if (absl::Status status = parts_.Put(name, part, bytes); !status.ok()) {
      return WithErrorInfo(absl::ResourceExhaustedError(absl::StrCat("part: ", status.message())),
                           "PART_TOO_LARGE");
    }
  }
  UpdateMetrics();
  return digest;
}

absl::StatusOr<std::shared_ptr<const StoredPart>> SceneRegistry::FindPart(
    const std::string& digest) {
  auto part = parts_.Get(digest);
  if (part == nullptr) {
    return WithErrorInfo(absl::NotFoundError(absl::StrCat("part ", Printable(digest.substr(0, 64)),
                                                          " is not on this server: upload it")),
                         kReasonPartUnknown, {{"part_digest", digest}});
  }
  return part;
}

absl::StatusOr<std::shared_ptr<const StoredScene>> SceneRegistry::FindScene(
    const std::string& digest) {
  auto scene = scenes_.Get(digest);
  if (scene == nullptr) {
    return WithErrorInfo(
        absl::NotFoundError(absl::StrCat("scene '", Printable(digest.substr(0, 64)),
                                         "' is not on this server: create it")),
        kReasonSceneUnknown, {{"scene_digest", digest.substr(0, 64)}});
  }
  return scene;
}

absl::StatusOr<JobRecord> SceneRegistry::CreateScene(const std::string& peer,
                                                     const std::string& request_id,
                                                     const v1::SceneSpec& spec) {
  if (request_id.size() > kMaxRequestIdBytes) {
    return InvalidFields({{"request_id", absl::StrCat("at most ", kMaxRequestIdBytes, " bytes")}});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(ParsedSceneSpec parsed, ParseSceneSpec(spec));
  const std::string digest = parsed.digest;

  std::lock_guard lock(mutex_);
  if (const auto it = requests_.find(request_id); it != requests_.end()) {
    if (it->second.digest != digest) {
      return WithErrorInfo(absl::AlreadyExistsError(absl::StrCat("request_id '", request_id,
                                                                 "' was used for another scene")),
                           "REQUEST_ID_REUSED");
    }
    // A retry gets its earlier job, even a failed one. Only if the scene was dropped since, it is
    // built again.
    absl::StatusOr<JobRecord> job = jobs_->Get(it->second.job_id);
    if (job.ok() && (job->state != JobState::kSucceeded || scenes_.Get(digest) != nullptr)) {
      return job;
    }
  }
  const auto remember = [&](const std::string& job_id) {
    if (request_id.empty()) return;
    if (requests_.insert_or_assign(request_id, Request{digest, job_id}).second) {
      request_order_.push_back(request_id);
      Trim(&requests_, &request_order_);
    }
  };
  if (const auto it = job_of_scene_.find(digest); it != job_of_scene_.end()) {
    absl::StatusOr<JobRecord> job = jobs_->Get(it->second);
    if (job.ok() && (!job->finished() ||
                     (job->state == JobState::kSucceeded && scenes_.Get(digest) != nullptr))) {
      remember(job->job_id);
      return job;
    }
  }
  // Parts are looked up now, so that the client learns at once what to upload, and again when the
  // job starts. The look-up marks them as recently used, so that they are not dropped soon.
  SIGHTLINE_RETURN_IF_ERROR(FindPart(parsed.part_digest).status());
  for (const auto& obstacle : parsed.obstacles) {
    SIGHTLINE_RETURN_IF_ERROR(FindPart(obstacle.part_digest).status());
  }
  absl::StatusOr<std::unique_ptr<JobRoom>> room = jobs_->Reserve(peer, [] { return int64_t{0}; });
  if (!room.ok()) {
    return WithRetryDelay(
        WithErrorInfo(absl::UnavailableError(absl::StrCat("overloaded: ", room.status().message())),
                      "OVERLOADED"),
        absl::Seconds(5));
  }
  // The store's own check of request_id would bind the id to one job for good, but a scene that was
  // dropped for lack of memory has to be built again by a new job.
  SIGHTLINE_ASSIGN_OR_RETURN(JobRecord job,
                             jobs_->Create(
                                 "scene", "", digest,
                                 [this, spec_copy = std::move(parsed)](JobContext& context) {
                                   return BuildScene(spec_copy, context);
                                 },
                                 *std::move(room)));
  remember(job.job_id);
  if (job_of_scene_.insert_or_assign(digest, job.job_id).second) {
    scene_order_.push_back(digest);
    Trim(&job_of_scene_, &scene_order_);
  }
  return job;
}

absl::StatusOr<std::string> SceneRegistry::BuildScene(const ParsedSceneSpec& spec,
                                                      JobContext& context) {
  if (scenes_.Get(spec.digest) != nullptr) return spec.digest;
  const absl::Time start = absl::Now();
  SceneDefinition definition;
  SIGHTLINE_ASSIGN_OR_RETURN(std::shared_ptr<const StoredPart> part, FindPart(spec.part_digest));
  definition.part = part->mesh;
  if (!spec.part_has_materials) {
    // Another client may have uploaded the same shape with materials.
    definition.part.triangle_material.clear();
    definition.part.material_names.clear();
  }
  for (const auto& obstacle : spec.obstacles) {
    SIGHTLINE_ASSIGN_OR_RETURN(std::shared_ptr<const StoredPart> body,
                               FindPart(obstacle.part_digest));
    definition.obstacles.push_back({body->mesh, obstacle.frame});
  }
  definition.rig = spec.rig;
  definition.sampling = spec.sampling;
  definition.field_directions = spec.field_directions;
  definition.uncertainty = spec.uncertainty;
  definition.domain = spec.domain;
  definition.detectability = spec.detectability;
  SceneBuildOptions options;
  options.on_progress = [&context](double progress, const std::string& message) {
    context.ReportProgress(progress, message);
  };
  options.cancelled = &context.cancelled();
  options.measured_scans = {measured_scans_, spec.geometry_digest};
  absl::StatusOr<std::unique_ptr<CoverageScene>> scene =
      backend_.build_scene(std::move(definition), options);
  if (context.cancelled()) return absl::CancelledError("scene was cancelled");
  if (!scene.ok()) {
    spdlog::warn("event=scene_failed scene={} code={} message={:?}", spec.digest,
                 absl::StatusCodeToString(scene.status().code()),
                 std::string(scene.status().message()));
    return scene.status();
  }
  auto stored = std::make_shared<StoredScene>();
  stored->scene = *std::move(scene);
  stored->spec = spec.normalised;
  const int64_t bytes = SceneBytes(*stored->scene);
  const size_t targets = stored->scene->targets().size();
  if (absl::Status status = scenes_.Put(spec.digest, std::move(stored), bytes); !status.ok()) {
    return absl::ResourceExhaustedError(absl::StrCat("scene: ", status.message()));
  }
  UpdateMetrics();
  spdlog::info("event=scene_built scene={} targets={} bytes={} seconds={:.3f}", spec.digest,
               targets, bytes, absl::ToDoubleSeconds(absl::Now() - start));
  return spec.digest;
}

void SceneRegistry::UpdateMetrics() {
  metrics_->SetParts(parts_.count(), parts_.bytes());
  metrics_->SetScenes(scenes_.count(), scenes_.bytes());
}

}  // namespace sightline
