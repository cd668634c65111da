// SPDX-License-Identifier: Apache-2.0
#include "core/registration/surface_deviation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <thread>
#include <utility>

#include "core/parallel/worker_threads.h"
#include "core/part/surface_geometry.h"
#include "core/surface_inference/surface_estimate.h"

namespace sightline {
namespace {

// A scan has many thousand points, so some are off by four standard deviations of their noise.
constexpr int kSureSteps = 4;

// One standard deviation along the direction in which a covariance is largest.
Eigen::Vector3d LargestDeviation(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
  return std::sqrt(std::max(0.0, eigen.eigenvalues()[2])) * eigen.eigenvectors().col(2);
}

// Calls work(begin, end) for intervals of [0, count) on several threads, each with data of its own.
void ForShares(size_t count, int threads, const std::function<void(size_t, size_t)>& work) {
  const size_t wanted = threads > 0 ? static_cast<size_t>(threads)
                                    : std::max<size_t>(1, std::thread::hardware_concurrency());
  const size_t used = std::clamp<size_t>(count / 256, 1, wanted);
  WorkerThreads pool;
  for (size_t k = 0; k < used; ++k) {
    const size_t begin = count * k / used, end = count * (k + 1) / used;
    pool.Start([&work, begin, end] { work(begin, end); });
  }
  pool.Join();
}

// Calls visit(point) for the points of a scan that are informative about a place, by ascending
// index.
template <typename Visit>
void VisitPoints(const IndexedScan& scan, const Eigen::Vector3f& place,
                 const Eigen::Vector3f& normal, double radius_m, float cos_gate,
                 const Visit& visit) {
  if (scan.points.positions_m.empty()) return;
  std::vector<uint32_t> near = scan.index.Within(place, radius_m);
  std::sort(near.begin(), near.end());
  for (const uint32_t p : near) {
    if (scan.points.normals[p].dot(normal) >= cos_gate) visit(p);
  }
}

// The points of a scan as a target sees them.
class TargetView {
 public:
  TargetView(const TargetSet& targets, size_t t, double radius_m, float cos_gate)
      : place_(targets.positions_m[t]),
        normal_(targets.normals[t]),
        axes_(TangentAxes(normal_)),
        radius_m_(radius_m),
        cos_gate_(cos_gate) {}

  // Calls visit(point, place in the tangent plane, variance along the target's normal).
  template <typename Visit>
  void Observe(const IndexedScan& scan, const Visit& visit) const {
    VisitPoints(scan, place_, normal_, radius_m_, cos_gate_, [&](uint32_t p) {
      const Eigen::Vector3f d = scan.points.positions_m[p] - place_;
      const double variance_m2 =
          scan.noise.DetectionVariance(scan.points.positions_m[p].cast<double>(),
                                       scan.points.normals[p].cast<double>(), normal());
      if (!(variance_m2 > 0) || !std::isfinite(variance_m2)) return;
      visit(p, Eigen::Vector2d(d.dot(axes_[0]), d.dot(axes_[1])), variance_m2);
    });
  }

  Eigen::Vector3d normal() const { return normal_.cast<double>(); }
  Eigen::Vector3d place() const { return place_.cast<double>(); }

 private:
  Eigen::Vector3f place_, normal_;
  std::array<Eigen::Vector3f, 2> axes_;
  double radius_m_;
  float cos_gate_;
};

// Weighted mean of the points that share a square of the tangent plane.
struct Cell {
  double weight = 0;  // sum of 1/variance
  Eigen::Vector2d place_sum_m = Eigen::Vector2d::Zero();
  double deviation_sum_m = 0;
};

float CosGate(double max_normal_angle_rad) {
  return static_cast<float>(std::cos(max_normal_angle_rad));
}

}  // namespace

PointsOnModel ProjectOntoModel(const SurfaceIndex& model,
                               std::span<const Eigen::Vector3d> positions_m,
                               std::span<const Eigen::Vector3d> normals, const ScanNoise* noise,
                               double reach_m, int threads) {
  struct Found {
    SurfacePoint on;
    Eigen::Vector3d place_m;
    bool sure = true;
  };
  std::vector<std::optional<Found>> found(positions_m.size());
  ForShares(positions_m.size(), threads, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Eigen::Vector3d facing = normals.empty() ? Eigen::Vector3d::Zero().eval() : normals[i];
      const auto on = model.Nearest(positions_m[i], facing, reach_m);
      if (!on) continue;
      found[i] = Found{*on, positions_m[i]};
      if (noise == nullptr) continue;
      const Eigen::Matrix3d covariance = noise->DetectionCovariance(on->position_m, on->normal);
      const double along = on->normal.dot(covariance * on->normal);
      if (!(along > 0) || !covariance.allFinite()) continue;
      const Eigen::Vector3d moved =
          covariance * on->normal * (on->Deviation(positions_m[i]) / along);
      // Grazing rays would move it along the surface without end.
      if (moved.norm() <= reach_m) found[i]->place_m -= moved;
      found[i]->sure = model.OnOneFace(*on, kSureDeviations * std::sqrt(covariance.trace())) &&
                       model.NoOtherFaceAlong(positions_m[i], LargestDeviation(covariance),
                                              kSureSteps, *on, facing);
    }
  });
  PointsOnModel points;
  for (size_t i = 0; i < found.size(); ++i) {
    if (!found[i]) {
      ++points.off_model;
      continue;
    }
    points.positions_m.push_back(found[i]->place_m.cast<float>());
    points.normals.push_back(found[i]->on.normal.cast<float>());
    points.deviations_m.push_back(static_cast<float>(found[i]->on.Deviation(positions_m[i])));
    points.distances_m.push_back(static_cast<float>(found[i]->on.distance_m));
    points.sure.push_back(found[i]->sure ? 1 : 0);
  }
  return points;
}

std::vector<DeviationEstimate> EstimateDeviations(const TargetSet& targets,
                                                  std::span<const SurfacePrior> priors,
                                                  double max_normal_angle_rad,
                                                  std::span<const IndexedScan* const> scans,
                                                  int threads) {
  std::vector<DeviationEstimate> estimates(targets.size());
  const float cos_gate = CosGate(max_normal_angle_rad);
  ForShares(targets.size(), threads, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      const TargetView view(targets, t, priors[t].neighbourhood_m(), cos_gate);
      const double cell_m = 0.5 * priors[t].length_scale_m;
      std::vector<std::vector<SurfaceObservation>> observations;
      std::vector<std::vector<double>> deviations_m;
      std::vector<double> common_m2;
      std::vector<size_t> seen_by;
      for (size_t s = 0; s < scans.size(); ++s) {
        const IndexedScan* scan = scans[s];
        std::map<std::pair<int64_t, int64_t>, Cell> cells;
        int32_t points = 0;
        view.Observe(*scan, [&](uint32_t p, const Eigen::Vector2d& place_m, double variance_m2) {
          if (scan->points.sure[p] == 0) return;
          ++points;
          Cell& cell =
              cells[{std::llround(place_m.x() / cell_m), std::llround(place_m.y() / cell_m)}];
          cell.weight += 1 / variance_m2;
          cell.place_sum_m += place_m / variance_m2;
          cell.deviation_sum_m += scan->points.deviations_m[p] / variance_m2;
        });
        const double common = scan->noise.CalibrationVariance(view.place(), view.normal());
        if (points == 0 || !std::isfinite(common)) continue;
        estimates[t].points += points;
        seen_by.push_back(s);
        std::vector<SurfaceObservation>& seen = observations.emplace_back();
        std::vector<double>& seen_m = deviations_m.emplace_back();
        for (const auto& [key, cell] : cells) {
          seen.push_back({cell.place_sum_m / cell.weight, 1 / cell.weight});
          seen_m.push_back(cell.deviation_sum_m / cell.weight);
        }
        common_m2.push_back(common);
      }
      const SurfaceWeights weights = DenseSurfaceWeights(priors[t], observations, common_m2);
      estimates[t].uncertainty_m = weights.uncertainty.total_m;
      estimates[t].parts = weights.uncertainty;
      estimates[t].scan_weights.assign(scans.size(), 0);
      for (size_t s = 0; s < seen_by.size(); ++s) {
        estimates[t].scan_weights[seen_by[s]] = static_cast<float>(weights.of_scans[s]);
      }
      for (size_t s = 0; s < deviations_m.size(); ++s) {
        for (size_t i = 0; i < deviations_m[s].size(); ++i) {
          estimates[t].mean_m += weights.of_points[s][i] * deviations_m[s][i];
        }
      }
    }
  });
  return estimates;
}

TargetBits CoveredByPoints(const TargetSet& targets, const TargetSampling& sampling,
                           const IndexedScan& scan, int threads) {
  std::vector<uint8_t> covered(targets.size(), 0);
  const float cos_gate = CosGate(sampling.max_normal_angle_rad);
  ForShares(targets.size(), threads, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      VisitPoints(scan, targets.positions_m[t], targets.normals[t], sampling.coverage_radius_m,
                  cos_gate, [&](uint32_t) { covered[t] = 1; });
    }
  });
  TargetBits bits(targets.size());
  for (size_t t = 0; t < covered.size(); ++t) {
    if (covered[t] != 0) bits.Set(t);
  }
  return bits;
}

PointUncertainties UncertaintiesFromPoints(const TargetSet& targets,
                                           std::span<const SurfacePrior> priors,
                                           double max_normal_angle_rad,
                                           std::span<const IndexedScan* const> scans, int threads) {
  PointUncertainties result;
  result.after_all.resize(targets.size());
  result.points.assign(targets.size(), 0);
  result.after_each_scan_m.resize(targets.size() * scans.size());
  const float cos_gate = CosGate(max_normal_angle_rad);
  ForShares(targets.size(), threads, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      const TargetView view(targets, t, priors[t].neighbourhood_m(), cos_gate);
      LocalSurface surface(priors[t]);
      std::vector<SurfaceObservation> observations;
      for (size_t s = 0; s < scans.size(); ++s) {
        observations.clear();
        view.Observe(*scans[s], [&](uint32_t, const Eigen::Vector2d& place_m, double variance_m2) {
          observations.push_back({place_m, variance_m2});
        });
        const double common = scans[s]->noise.CalibrationVariance(view.place(), view.normal());
        if (!observations.empty() && std::isfinite(common)) {
          result.points[t] += static_cast<int32_t>(observations.size());
          surface.AddScan(observations, common);
        }
        result.after_each_scan_m[t * scans.size() + s] =
            static_cast<float>(surface.Uncertainty().total_m);
      }
      result.after_all[t] = surface.Uncertainty();
    }
  });
  return result;
}

}  // namespace sightline
