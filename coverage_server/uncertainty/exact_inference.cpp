// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/uncertainty/exact_inference.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/part/surface_geometry.h"
#include "core/triangulation/triangulation.h"

namespace sightline {

ScanPoints::ScanPoints(const ScanInPart& scan, const UncertaintyModel& model,
                       std::span<const MeasurementPoint> points, float cell_m)
    : scan_(scan), detection_(model.detection), calibration_(scan, model.calibration) {
  if (points.empty()) return;
  Eigen::AlignedBox3f box;
  for (const MeasurementPoint& point : points) box.extend(point.position_m);
  // A margin of one cell, so that neighbours of a cell that holds points need no tests.
  origin_ = box.min().array() - cell_m;
  inverse_cell_ = 1 / cell_m;
  for (int axis = 0; axis < 3; ++axis) {
    size_[axis] = static_cast<int>(box.sizes()[axis] * inverse_cell_) + 3;
  }
  const auto cell_of = [this](const Eigen::Vector3f& position_m) {
    const Eigen::Vector3i cell = ((position_m - origin_) * inverse_cell_).cast<int>();
    return (static_cast<uint64_t>(cell.z()) * size_[1] + cell.y()) * size_[0] + cell.x();
  };
  std::vector<uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0u);
  std::vector<uint64_t> cell(points.size());
  for (size_t i = 0; i < points.size(); ++i) cell[i] = cell_of(points[i].position_m);
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return cell[a] != cell[b] ? cell[a] < cell[b] : a < b; });
  points_.reserve(points.size());
  for (const uint32_t i : order) {
    if (cells_.empty() || cells_.back() != cell[i]) {
      cells_.push_back(cell[i]);
      begin_.push_back(static_cast<uint32_t>(points_.size()));
    }
    points_.push_back({points[i].position_m, points[i].normal});
  }
  begin_.push_back(static_cast<uint32_t>(points_.size()));
}

template <typename Visit>
void ScanPoints::VisitNear(const Eigen::Vector3f& place_m, const Visit& visit) const {
  VisitCells(place_m, [&](uint32_t begin, uint32_t end) {
    for (uint32_t k = begin; k < end; ++k) visit(points_[k]);
  });
}

double ScanPoints::LikelyInformation(const Eigen::Vector3f& place_m,
                                     const Eigen::Vector3f& normal) const {
  uint32_t count = 0;
  VisitCells(place_m, [&](uint32_t begin, uint32_t end) { count += end - begin; });
  if (count == 0) return 0;
  const double variance = NoiseVariance({place_m, normal}, normal);
  return variance > 0 ? count / variance : 0;
}

template <typename Visit>
void ScanPoints::VisitCells(const Eigen::Vector3f& place_m, const Visit& visit) const {
  if (cells_.empty()) return;
  const Eigen::Vector3f place = (place_m - origin_) * inverse_cell_;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(place[axis] >= 0 && place[axis] < static_cast<float>(size_[axis]))) return;
  }
  const Eigen::Vector3i cell = place.cast<int>();
  for (int z = std::max(0, cell.z() - 1); z <= std::min(size_[2] - 1, cell.z() + 1); ++z) {
    for (int y = std::max(0, cell.y() - 1); y <= std::min(size_[1] - 1, cell.y() + 1); ++y) {
      const uint64_t row = (static_cast<uint64_t>(z) * size_[1] + y) * size_[0];
      const uint64_t first = row + static_cast<uint64_t>(std::max(0, cell.x() - 1));
      const uint64_t last = row + static_cast<uint64_t>(std::min(size_[0] - 1, cell.x() + 1));
      auto found = std::lower_bound(cells_.begin(), cells_.end(), first);
      for (; found != cells_.end() && *found <= last; ++found) {
        const auto i = static_cast<size_t>(found - cells_.begin());
        visit(begin_[i], begin_[i + 1]);
      }
    }
  }
}

Eigen::Vector3f ScanPoints::ViewOf(const Eigen::Vector3f& place_m) const {
  const Eigen::Vector3d p = place_m.cast<double>();
  const double stage = scan_.lit_gradient.dot(p) + scan_.lit_offset_m;
  return (p - scan_.camera.origin_m + stage * scan_.scan_direction).cast<float>();
}

double ScanPoints::NoiseVariance(const Point& point, const Eigen::Vector3f& along) const {
  const Eigen::Vector3d view = ViewOf(point.position_m).cast<double>();
  const Eigen::Vector3d normal = along.cast<double>();
  const double depth = view.dot(scan_.camera.z_axis);
  const Eigen::Vector3d ray = view / depth;
  const Eigen::Vector2d by_image = ImageDerivativesAlong(
      normal, scan_.camera, scan_.focal_length_px, scan_.sheet_normal, ray, depth);
  const double distance = view.norm();
  const double cosine = std::clamp(-view.dot(point.normal.cast<double>()) / distance, -1.0, 1.0);
  const double noise_px = detection_.At(distance, std::acos(cosine));
  return noise_px * noise_px * by_image.squaredNorm();
}

double ScanPoints::CalibrationVarianceAt(const Eigen::Vector3f& place_m,
                                         const Eigen::Vector3f& normal) const {
  return calibration_.any() ? calibration_.At(ViewOf(place_m), normal) : 0;
}

void InferTargets(const TargetSet& targets, const TargetPriors& priors, double max_normal_angle_rad,
                  std::span<const std::shared_ptr<const ScanPoints>> scans,
                  std::span<const uint32_t> targets_asked, bool after_each_scan,
                  std::span<const float> enough_m, std::span<TargetUncertainty> results,
                  const std::atomic<bool>* cancelled) {
  std::vector<LocalSurface> surfaces;
  for (const SurfacePrior& prior : priors.priors) surfaces.emplace_back(prior);
  const auto cos_gate = static_cast<float>(std::cos(max_normal_angle_rad));
  std::vector<SurfaceObservation> observations;
  std::vector<std::pair<double, size_t>> order;  // expected information and index of scans
  for (size_t i = 0; i < targets_asked.size(); ++i) {
    if (cancelled != nullptr && cancelled->load(std::memory_order_relaxed)) return;
    const uint32_t t = targets_asked[i];
    const Eigen::Vector3f& place = targets.positions_m[t];
    const Eigen::Vector3f& normal = targets.normals[t];
    const auto axes = TangentAxes(normal);
    const auto radius = static_cast<float>(priors.of(t).neighbourhood_m());
    LocalSurface& surface = surfaces[priors.prior_of[t]];
    surface.Clear();
    results[i].points = 0;
    order.clear();
    for (size_t s = 0; s < scans.size(); ++s) order.push_back({0, s});
    if (!enough_m.empty()) {
      for (auto& [information, s] : order) {
        information = scans[s]->LikelyInformation(place, normal);
      }
      std::stable_sort(order.begin(), order.end(),
                       [](const auto& a, const auto& b) { return a.first > b.first; });
    }
    // The posterior takes as long as some scans, so it is computed only when it may suffice.
    double told = 0, ask_at = 0;
    for (const auto& [likely, s] : order) {
      const auto& scan = scans[s];
      observations.clear();
      scan->VisitNear(place, [&](const ScanPoints::Point& point) {
        const Eigen::Vector3f d = point.position_m - place;
        if (d.squaredNorm() > radius * radius || point.normal.dot(normal) < cos_gate) return;
        const double variance = scan->NoiseVariance(point, normal);
        if (!(variance > 0) || !std::isfinite(variance)) return;
        observations.push_back({Eigen::Vector2d(d.dot(axes[0]), d.dot(axes[1])), variance});
      });
      if (!observations.empty()) {
        results[i].points += static_cast<int32_t>(observations.size());
        surface.AddScan(observations, scan->CalibrationVarianceAt(place, normal));
        for (const SurfaceObservation& point : observations) told += 1 / point.noise_variance_m2;
        if (!enough_m.empty() && told >= ask_at) {
          const double u_m = surface.Uncertainty().total_m;
          if (u_m <= enough_m[i]) break;
          // Uncertainty falls with the square root of the information.
          ask_at = told * std::min(4.0, u_m * u_m / (double{enough_m[i]} * enough_m[i]));
        }
      }
      if (!after_each_scan) continue;
      std::vector<float>& after = results[i].after_each_scan_m;
      // A scan without observations changes nothing.
      after.push_back(observations.empty() && !after.empty()
                          ? after.back()
                          : static_cast<float>(surface.Uncertainty().total_m));
    }
    results[i].uncertainty = surface.Uncertainty();
  }
}

}  // namespace sightline
