// SPDX-License-Identifier: Apache-2.0
// Directional visibility field: for every direction, the probes of every target that are seen.
//
// For every cell of an octahedral map one orthographic depth image of the part is rendered; every
// probe is depth-tested in it. A gain query is then two byte look-ups per target instead of two
// renderings (differs from the thesis, section 4.5, which renders every frame). Valid where the
// sensor stands outside the part's hull; the exact evaluator decides everywhere else.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"
#include "core/targets/target_set.h"
#include "coverage_server/visibility/octahedral_map.h"
#include "coverage_server/visibility/surface_probes.h"

namespace sightline {

inline constexpr int kTargetsPerBlock = 64;

// Bytes [block][cell][target in block]; bit k of a byte: probe k of the target is seen from the
// cell's direction. Cells below a probe's horizon hold the bit of the nearest direction above
// it, so that directions just above the horizon do not read a hidden cell.
class VisibilityField {
 public:
  VisibilityField(OctahedralMap map, size_t targets);

  const OctahedralMap& map() const { return map_; }
  size_t blocks() const { return blocks_; }
  size_t bytes() const { return blocks_ * map_.cells() * kTargetsPerBlock; }
  // The kTargetsPerBlock bytes of a block and cell.
  const uint8_t* Row(size_t block, int cell) const {
    return data_.get() + (block * map_.cells() + cell) * kTargetsPerBlock;
  }
  const uint8_t* BlockData(size_t block) const { return Row(block, 0); }
  uint8_t* mutable_data() { return data_.get(); }
  uint8_t Probes(size_t target, int cell) const {
    return Row(target / kTargetsPerBlock, cell)[target % kTargetsPerBlock];
  }

 private:
  struct Unmap {
    size_t bytes;
    void operator()(uint8_t* data) const;
  };
  friend absl::StatusOr<std::unique_ptr<VisibilityField>> BuildVisibilityField(
      const TriangleMesh&, std::span<const TriangleMesh* const>, const TargetSet&,
      const SurfaceProbes&, const struct FieldBuildOptions&);

  OctahedralMap map_;
  size_t blocks_;
  std::unique_ptr<uint8_t, Unmap> data_;
};

struct FieldBuildOptions {
  int directions = kDefaultFieldDirections;  // rounded up to an even square
  int processes = 0;                         // 0: all cores
  double pixel_size_m = 0;                   // 0: 1/768 of the scene's diagonal
  double simplification_m = 1e-4;            // 0: none
  bool coherent_occlusion = true;
  std::function<void(double)> on_progress;
  const std::atomic<bool>* cancelled = nullptr;
};

// Worker processes render the depth images by OSMesa, because llvmpipe contexts in one process slow
// each other down. `obstacles` occlude too (part coordinates). Bytes do not depend on `processes`.
// A killed worker is replaced and its unfinished tiles are rendered again; UNAVAILABLE: too many
// workers were killed. CANCELLED; INTERNAL: GL or a worker failed; RESOURCE_EXHAUSTED: no memory or
// no processes.
absl::StatusOr<std::unique_ptr<VisibilityField>> BuildVisibilityField(
    const TriangleMesh& part, std::span<const TriangleMesh* const> obstacles,
    const TargetSet& targets, const SurfaceProbes& probes, const FieldBuildOptions& options);

}  // namespace sightline
