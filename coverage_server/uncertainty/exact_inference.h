// SPDX-License-Identifier: Apache-2.0
// Uncertainty of the surface at targets after several scans: Gaussian-process regression on the
// points that the scans measure (thesis 3.4, 6.3.1).
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/surface_inference/surface_inference.h"
#include "core/targets/target_set.h"
#include "core/uncertainty/uncertainty_model.h"
#include "coverage_server/answers/scene_answers.h"
#include "coverage_server/scan/measured_scans.h"
#include "coverage_server/scan/scan_in_part.h"
#include "coverage_server/uncertainty/calibration_variance.h"
#include "coverage_server/uncertainty/target_priors.h"

namespace sightline {

// The measured points of one scan, ordered for look-up by place.
class ScanPoints {
 public:
  // `cell_m`: edge of the look-up grid's cells.
  ScanPoints(const ScanInPart& scan, const UncertaintyModel& model,
             std::span<const MeasurementPoint> points, float cell_m);

  // Calls visit(point) for every point within one cell's edge of `place_m` along each axis.
  struct Point {
    Eigen::Vector3f position_m;
    Eigen::Vector3f normal;
  };
  template <typename Visit>
  void VisitNear(const Eigen::Vector3f& place_m, const Visit& visit) const;

  // Variance [m^2] by detection noise of a point of the scan along a unit vector, given the normal
  // of the surface it lies on.
  double NoiseVariance(const Point& point, const Eigen::Vector3f& along) const;
  // Variance [m^2] along `normal` of the error that all points near `place_m` have in common.
  double CalibrationVarianceAt(const Eigen::Vector3f& place_m, const Eigen::Vector3f& normal) const;

  // Expected information of the scan at a place [1/m^2]: number of points in the cells around it
  // times 1/variance of a point at the place itself. 0: no points.
  double LikelyInformation(const Eigen::Vector3f& place_m, const Eigen::Vector3f& normal) const;

  // Bytes of the points, which are nearly all of its memory.
  int64_t bytes() const { return static_cast<int64_t>(points_.size() * sizeof(Point)); }

 private:
  // Calls visit(begin, end) for the points of every cell about a place.
  template <typename Visit>
  void VisitCells(const Eigen::Vector3f& place_m, const Visit& visit) const;
  Eigen::Vector3f ViewOf(const Eigen::Vector3f& place_m) const;

  ScanInPart scan_;
  LineDetectionNoise detection_;
  CalibrationVariance calibration_;
  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();
  float inverse_cell_ = 0;
  std::array<int, 3> size_ = {0, 0, 0};
  // Cells that hold points, ascending, and where their points begin; one more begin at the end.
  std::vector<uint64_t> cells_;
  std::vector<uint32_t> begin_;
  std::vector<Point> points_;
};

// Posterior at the targets `targets_asked` (indices). A point informs about a target if it lies
// within the neighbourhood of the target's prior, on a surface whose normal differs from the
// target's by at most max_normal_angle_rad (thesis 6.3.1). With `enough_m`, one per queried target,
// the most informative scans come first, and further scans are left out once the uncertainty is
// at most that. Stops early when *cancelled.
void InferTargets(const TargetSet& targets, const TargetPriors& priors, double max_normal_angle_rad,
                  std::span<const std::shared_ptr<const ScanPoints>> scans,
                  std::span<const uint32_t> targets_asked, bool after_each_scan,
                  std::span<const float> enough_m, std::span<TargetUncertainty> results,
                  const std::atomic<bool>* cancelled);

}  // namespace sightline
