// SPDX-License-Identifier: Apache-2.0
// Parts and scenes in memory, and the jobs that build scenes.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "absl/status/statusor.h"
#include "core/job/job_store.h"
#include "core/memo/lru_store.h"
#include "core/part/part_health.h"
#include "coverage_server/scene/coverage_scene.h"
#include "coverage_server/service/coverage_backend.h"
#include "coverage_server/service/coverage_metrics.h"
#include "coverage_server/service/scene_spec.h"
#include "sightline/v1/coverage_service.pb.h"

namespace sightline {

struct StoredPart {
  TriangleMesh mesh;
  PartHealth health;
};

struct StoredScene {
  std::unique_ptr<CoverageScene> scene;
  v1::SceneSpec spec;  // normalised
};

// Scenes that may wait to be built.
inline constexpr int kMaxUnfinishedScenes = 64;

// Enough for about fifty scans of a part that fills the image.
inline constexpr int64_t kMeasuredScansBytes = 128 << 20;

// Thread-safe. `jobs` must outlive it, but must not run jobs any more when it is destroyed.
class SceneRegistry {
 public:
  SceneRegistry(CoverageBackend backend, JobStore* jobs, CoverageMetrics* metrics,
                int64_t max_part_bytes, int64_t max_scene_bytes);

  // Stores a part and returns its digest. RESOURCE_EXHAUSTED: the part alone exceeds the limit.
  absl::StatusOr<std::string> AddPart(std::shared_ptr<const StoredPart> part);

  // Returns the job (kind "scene") that builds or has built this scene. Idempotent by request_id
  // (ALREADY_EXISTS: it was used for another scene; empty: no such check) and by content: all
  // requests for a scene share the one job that builds or has built it. NOT_FOUND (reason
  // PART_UNKNOWN, metadata part_digest): the part must be uploaded first. UNAVAILABLE (OVERLOADED):
  // too many scenes, or too many scenes of `peer`, wait to be built.
  absl::StatusOr<JobRecord> CreateScene(const std::string& peer, const std::string& request_id,
                                        const v1::SceneSpec& spec);

  // NOT_FOUND (reason SCENE_UNKNOWN) if it must be created first.
  absl::StatusOr<std::shared_ptr<const StoredScene>> FindScene(const std::string& digest);

 private:
  absl::StatusOr<std::string> BuildScene(const ParsedSceneSpec& spec, JobContext& context);
  absl::StatusOr<std::shared_ptr<const StoredPart>> FindPart(const std::string& digest);
  void UpdateMetrics();

  const CoverageBackend backend_;
  JobStore* const jobs_;
  CoverageMetrics* const metrics_;
  LruStore<StoredPart> parts_;
  LruStore<StoredScene> scenes_;
  // Shared by all scenes.
  const std::shared_ptr<LruStore<MeasuredScans::Points>> measured_scans_;

  std::mutex mutex_;  // held while deciding which job a request belongs to
  struct Request {
    std::string digest;
    std::string job_id;
  };
  std::map<std::string, Request> requests_;
  std::deque<std::string> request_order_;
  std::map<std::string, std::string> job_of_scene_;
  std::deque<std::string> scene_order_;
};

}  // namespace sightline
