// SPDX-License-Identifier: Apache-2.0
// Renders the directions of a visibility field; runs in worker processes on shared memory.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "absl/status/status.h"

namespace sightline {

// Input of all workers, in one shared mapping; arrays follow at the stated byte offsets. Plain
// data: workers are other processes of the same program.
struct FieldJob {
  int32_t map_side;  // multiple of kTileSide
  int32_t cull_back_faces;
  int32_t coherent_occlusion;
  float pixel_size_m;
  float box_min[3], box_max[3];
  uint32_t vertex_count;    // x, y, z floats
  uint32_t triangle_count;  // three vertex indices, grouped by cluster
  uint32_t cluster_count;
  uint32_t cluster_vertex_count;
  uint32_t target_count;  // padded to whole blocks
  uint64_t vertices, triangles, triangle_normals, clusters, cluster_vertices;
  // Six float arrays (x, y, z, nx, ny, nz) of kProbesPerTarget * target_count each, probe-major.
  uint64_t probes;

  // One std::atomic<int32_t> for every tile: kTileWaiting, kTileDone or the number of the worker
  // that has taken it.
  uint64_t tiles;

  std::atomic<int32_t> directions_done;

  template <typename T>
  const T* At(uint64_t offset) const {
    return reinterpret_cast<const T*>(reinterpret_cast<const char*>(this) + offset);
  }
};

inline constexpr int kTileSide = 8;
inline constexpr int32_t kTileWaiting = 0;
inline constexpr int32_t kTileDone = -1;

inline int TileCount(const FieldJob& job) {
  return job.map_side * job.map_side / (kTileSide * kTileSide);
}
inline std::atomic<int32_t>* TileStates(FieldJob& job) {
  return reinterpret_cast<std::atomic<int32_t>*>(reinterpret_cast<char*>(&job) + job.tiles);
}

// Renders tiles as worker `number` (>= 1) until none waits; writes bytes
// [block][cell][target in block] to `field`. Every tile starts from scratch, so its bytes do not
// depend on the worker, even if another worker had begun it.
absl::Status RenderFieldTiles(FieldJob& job, uint8_t* field, int32_t number);

}  // namespace sightline
