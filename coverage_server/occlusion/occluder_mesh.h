// SPDX-License-Identifier: Apache-2.0
// Triangles of part and obstacles as the visibility field draws them: simplified, in clusters.
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
  // All its triangles face away from directions d with axis . d >= cutoff.
  float cone_axis[3];
  float cone_cutoff;
};

struct OccluderMesh {
  std::span<const float> vertices;      // x, y, z in metres
  std::span<const uint32_t> triangles;  // three vertices each, grouped by cluster
  std::span<const float> normals;       // x, y, z per triangle, of any length
  std::span<const OccluderCluster> clusters;
  std::span<const float> cluster_vertices;  // x, y, z: corners and points between them
  // Back faces hide nothing that a front face does not hide too.
  bool closed = true;
  std::shared_ptr<const void> storage;  // of the arrays above
};

struct OccluderOptions {
  double simplification_m = 1e-4;  // by at most so much; 0: not at all
  float point_spacing_m = 0;       // of cluster_vertices inside large triangles
  // More triangles than this are worked on in a process of its own, if there is a program for it:
  // the library that simplifies cannot be stopped. Fewer take less than 100 ms.
  size_t most_triangles_here = 50'000;
};

// The bytes do not depend on where it is done. CANCELLED soon after *cancelled; other errors as of
// RunWorkerTask().
absl::StatusOr<OccluderMesh> MakeOccluderMesh(const TriangleMesh& part,
                                              std::span<const TriangleMesh* const> obstacles,
                                              const OccluderOptions& options,
                                              const std::atomic<bool>* cancelled);

// The task for the other process.
WorkerTask OccluderMeshTask();

}  // namespace sightline
