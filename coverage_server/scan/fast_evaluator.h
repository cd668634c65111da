// SPDX-License-Identifier: Apache-2.0
// Gain estimates from the visibility field.
#pragma once

#include <atomic>
#include <span>
#include <vector>

#include "core/targets/target_set.h"
#include "coverage_server/detectability/light_map.h"
#include "coverage_server/scan/scan_in_part.h"
#include "coverage_server/visibility/visibility_field.h"

namespace sightline {

// A target of which camera and laser see at least one probe at the moment when the probe is lit.
struct SeenTarget {
  uint32_t target;
  uint8_t probes;  // bit k: probe k
};

// Coverage of one scan by the estimate from the visibility field.
struct FastScan {
  TargetBits covered;
  // Stage positions at which the covered (or listed seen) targets are lit; start > end: none.
  double stage_start_m = 1;
  double stage_end_m = 0;
  // Seen targets, ascending, even if no frame and column come close enough to cover them; filled
  // only on request.
  std::vector<SeenTarget> seen;
};

class FastEvaluator {
 public:
  // A target's probes, one array per coordinate.
  struct alignas(32) TargetProbes {
    float x[kProbesPerTarget] = {}, y[kProbesPerTarget] = {}, z[kProbesPerTarget] = {};
    float nx[kProbesPerTarget] = {}, ny[kProbesPerTarget] = {}, nz[kProbesPerTarget] = {};
  };

  // Limits by light: the map, and the table of every target (LightLimit::EntryOf).
  struct TargetLight {
    const LightMap* map = nullptr;  // null: light limits nothing
    std::vector<int16_t> entries;
  };

  // `field` and the light's map must outlive the evaluator.
  FastEvaluator(const TargetSet& targets, const TargetSampling& sampling,
                const SurfaceProbes& probes, const VisibilityField& field, TargetLight light);
  FastEvaluator(const TargetSet& targets, const TargetSampling& sampling,
                const SurfaceProbes& probes, const VisibilityField& field)
      : FastEvaluator(targets, sampling, probes, field, TargetLight()) {}

  // A target counts as covered if the grid of frames and columns puts a point near one of its
  // probes that, when lit, faces camera and laser, is seen from both, and lies within field of
  // view, fan, range and admissible depth, at a place where a permitted exposure shows the line.
  // Evaluates the whole batch block by block, so that the field is read once per batch.
  // `with_seen`: also lists seen targets. Stops early when *cancelled.
  void Evaluate(std::span<const ScanInPart> scans, std::span<FastScan> results, bool with_seen,
                const std::atomic<bool>* cancelled) const;

 private:
  struct Block {
    alignas(64) float x[kTargetsPerBlock], y[kTargetsPerBlock], z[kTargetsPerBlock];
    alignas(64) float nx[kTargetsPerBlock], ny[kTargetsPerBlock], nz[kTargetsPerBlock];
    // Sine of the largest angle between a probe's normal and the target's: 0 on flat surfaces.
    alignas(64) float horizon[kTargetsPerBlock];
    float max_horizon = 0;
    Eigen::Vector3f centre;
    float radius;
    Eigen::Vector3f cone_axis;
    float cone_sine;  // sine of the half angle of the normals' cone; 2: no useful cone
  };
  struct Lanes;
  struct SeenLane {
    uint8_t lane;
    uint8_t probes;
  };
  // Removes seen targets of a block on which no permitted exposure shows the line: at the target
  // and, on curved surfaces, at its probes. Returns the number of remaining targets.
  int KeepLit(const struct FloatScan& scan, size_t block, SeenLane* seen, int count) const;
  static void TestBlock(const Block& block, const struct FloatScan& scan, int map_side,
                        Lanes& lanes);

  std::vector<Block> blocks_;
  std::vector<TargetProbes> probes_;
  size_t target_count_;
  float coverage_radius_m_;
  const VisibilityField& field_;
  TargetLight light_;
};

}  // namespace sightline
