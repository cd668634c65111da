// SPDX-License-Identifier: Apache-2.0
// Fast estimate of the information of a scan about every target that it sees.
//
// Points of a scan lie on the surface in a grid of frames and columns with the density
//   rho = |f (t.e - x' t.w) / z| / (step |n.X|)                                     [1/m^2]
// (n sheet normal, t = n x N for the target's normal N, e and w the image's x and the optical axis,
// x' = image x / f, z depth, X the scan direction). Each observes the surface along N with the
// variance of its detection (core/triangulation)
//   sigma^2 = u_px^2 (z/f)^2 [ (N.e)^2 + (N.y - (N.r)(n.y)/(n.r))^2 ].
// lambda = rho / sigma^2 adds up over scans (core/surface_inference). Other losses (the scan's
// border, frames too far apart, errors of calibration) are expressed as the density of a complete,
// dense, well calibrated scan that would leave as much uncertainty. This *equivalent* information
// density is returned.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/targets/target_set.h"
#include "core/uncertainty/uncertainty_model.h"
#include "coverage_server/scan/fast_evaluator.h"
#include "coverage_server/scan/scan_in_part.h"
#include "coverage_server/uncertainty/surface_extent.h"
#include "coverage_server/uncertainty/target_priors.h"
#include "coverage_server/visibility/surface_probes.h"

namespace sightline {

// Posterior standard deviation u and information density of a prior, tabulated both ways as
// logarithms: ln u^2 [m^2] and ln of the density [1/m^4].
class InformationTable {
 public:
  // `border_distances_m`: how far inside the measured surface a target may lie, ascending.
  InformationTable(const SurfacePrior& prior, std::span<const double> border_distances_m);

  // Log variance in the middle of the measured surface.
  float LogVarianceAt(float log_density) const;
  // Its inverse.
  float LogDensityFor(float log_variance) const;
  // Effective log density of a target at border_distances_m[i] from the border of the surface.
  float AtBorder(size_t i, float log_density) const;
  // Variance [m^2] that points a spacing [m] apart leave between them (SamplingVariance); 0 for
  // spacings up to half the length scale, where it is below 1e-8 of the prior's.
  float SamplingVarianceAt(float spacing_m) const;

 private:
  static constexpr int kEntries = 257;
  std::array<float, kEntries> log_variance_;
  std::array<float, kEntries> log_density_;
  float log_variance_min_ = 0, log_variance_step_ = 1;
  std::vector<std::array<float, kEntries>> log_border_density_;
  // Standard deviations, evenly spaced in the spacing over the length scale.
  std::array<float, kEntries> sampling_deviation_;
  float per_spacing_ = 1;
};

class InformationEstimator {
 public:
  // `extent_costs`: one per target. `targets` and `priors` must outlive the estimator.
  InformationEstimator(const TargetSet& targets, const SurfaceProbes& probes,
                       const TargetPriors& priors, const UncertaintyModel& model,
                       std::vector<ExtentCost> extent_costs);

  // Equivalent information density [1/m^4] of every target of `seen`, in order; 0 for targets that
  // the scan does not inform about.
  void Estimate(const ScanInPart& scan, std::span<const SeenTarget> seen,
                std::span<float> information) const;

 private:
  const TargetSet& targets_;
  const TargetPriors& priors_;
  UncertaintyModel model_;
  std::vector<InformationTable> tables_;
  std::vector<ExtentCost> extent_costs_;
  // ln u^2 of kExtentLevels, of every prior.
  std::vector<std::array<float, kExtentLevels.size()>> level_log_variance_;
  // Probes that stand on the ring around the target, bit by bit: elsewhere the surface ends.
  std::vector<uint8_t> distinct_probes_;
};

}  // namespace sightline
