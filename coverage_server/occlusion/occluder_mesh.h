// SPDX-License-Identifier: Apache-2.0
// Triangles of part and obstacles for the visibility field: simplified and grouped in clusters.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"
#include "coverage_server/worker_process/worker_task.h"

namespace sightline {

// A group of neighbouring triangles that is drawn or skipped as a whole.
struct OccluderCluster {
  uint32_t first_triangle, triangle_count;
  uint32_t first_vertex, vertex_count;  // into cluster_vertices
  // All triangles of the cluster face away from directions d with axis . d >= cutoff.
  float cone_axis[3];
  float cone_cutoff;
};

struct OccluderMesh {
  std::span<const float> vertices;      // x, y, z in metres
  std::span<const uint32_t> triangles;  // three vertices each, grouped by cluster
  std::span<const float> normals;       // x, y, z per triangle, of any length
  std::span<const OccluderCluster> clusters;
  std::span<const float> cluster_vertices;  // x, y, z: corners and points between them
  // True if back faces hide only places that front faces hide too.
  bool closed = true;
  std::shared_ptr<const void> storage;  // of the arrays above
};

struct OccluderOptions {
  double simplification_m = 1e-4;  // largest error of simplification; 0: no simplification
  float point_spacing_m = 0;       // spacing of cluster_vertices inside large triangles
  // More triangles than this are simplified in a separate process, if there is a program for it,
  // because the library cannot be stopped. Fewer triangles take less than 100 ms.
  size_t most_triangles_here = 50'000;
};

// The result does not depend on the process that makes it. CANCELLED soon after *cancelled; other
// errors as for RunWorkerTask().
absl::StatusOr<OccluderMesh> MakeOccluderMesh(const TriangleMesh& part,
                                              std::span<const TriangleMesh* const> obstacles,
                                              const OccluderOptions& options,
                                              const std::atomic<bool>* cancelled);

// The task that runs in the separate process.
WorkerTask OccluderMeshTask();

}  // namespace sightline
