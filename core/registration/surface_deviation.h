// SPDX-License-Identifier: Apache-2.0
// Estimates the surface of a registered part: its deviation from the CAD model at targets, from the
// points measured around them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/part/point_index.h"
#include "core/registration/scan_noise.h"
#include "core/registration/surface_index.h"
#include "core/surface_inference/surface_inference.h"
#include "core/targets/target_set.h"

namespace sightline {

// Points of one scan on the model, in CAD coordinates with the registered pose taken off; arrays of
// one length.
struct PointsOnModel {
  std::vector<Eigen::Vector3f> positions_m;
  std::vector<Eigen::Vector3f> normals;  // of the model where the point belongs
  std::vector<float> deviations_m;       // from the model along that normal, as measured
  std::vector<float> distances_m;        // from the model, as measured
  std::vector<uint8_t> sure;  // noise cannot well have brought the point from another face
  // Points of the scan that are farther than the reach from any surface that faces their way, or
  // NaN.
  int64_t off_model = 0;
};

// With the noise of the points, their positions are the likeliest ones on the model's surface,
// x - C n (n . d) / (n . C n) for the deviation vector d and the covariance C (Gauss-Markov): noise
// mostly acts along the camera's rays, and would move points of surfaces seen at a slant sideways.
// Points within two standard deviations of another face are then not sure, nor are those that four
// standard deviations along their rays may have brought from one. `noise` null: positions
// as measured, all sure.
//
// `positions_m` in CAD coordinates. `normals`: empty, or as measured (zero: not known). In the
// order of the points whatever the number of threads; `threads` 0: all cores.
PointsOnModel ProjectOntoModel(const SurfaceIndex& model,
                               std::span<const Eigen::Vector3d> positions_m,
                               std::span<const Eigen::Vector3d> normals, const ScanNoise* noise,
                               double reach_m, int threads);

// Points of a scan, to be looked up by place, with their information.
struct IndexedScan {
  IndexedScan(PointsOnModel on_model, ScanNoise scan_noise)
      : points(std::move(on_model)), noise(std::move(scan_noise)), index(points.positions_m) {}
  PointsOnModel points;
  ScanNoise noise;
  PointIndex<3> index;
};

// Deviation at one target; no points: the prior.
struct DeviationEstimate {
  double mean_m = 0;                // along the target's normal, positive outside
  double uncertainty_m = 0;         // posterior standard deviation, the pose taken as known
  int32_t points = 0;               // that inform about it
  SurfaceUncertainty parts{};       // of `uncertainty_m`
  std::vector<float> scan_weights;  // sum of the weights of each scan's points in the mean
};

// Gaussian-process regression of the deviation (core/surface_inference) on the sure points within
// the neighbourhood of the prior whose surface faces the target's way within the gate on normals.
// `priors`: one per target. Points of a scan that share a square of half the length scale in the
// target's tangent plane enter as their mean.
std::vector<DeviationEstimate> EstimateDeviations(const TargetSet& targets,
                                                  std::span<const SurfacePrior> priors,
                                                  double max_normal_angle_rad,
                                                  std::span<const IndexedScan* const> scans,
                                                  int threads);

// Targets that have a point within the coverage radius on a surface that faces their way within the
// gate on normals (docs/method.md).
TargetBits CoveredByPoints(const TargetSet& targets, const TargetSampling& sampling,
                           const IndexedScan& scan, int threads);

// Posterior uncertainties after the first scan, the first two, and so on: [target][scan], by all
// points.
struct PointUncertainties {
  std::vector<SurfaceUncertainty> after_all;  // one per target
  std::vector<int32_t> points;
  std::vector<float> after_each_scan_m;
};
PointUncertainties UncertaintiesFromPoints(const TargetSet& targets,
                                           std::span<const SurfacePrior> priors,
                                           double max_normal_angle_rad,
                                           std::span<const IndexedScan* const> scans, int threads);

}  // namespace sightline
