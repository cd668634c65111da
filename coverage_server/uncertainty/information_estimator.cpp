// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/uncertainty/information_estimator.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "coverage_server/uncertainty/calibration_variance.h"

namespace sightline {
namespace {

// Range of tabulated densities [1/m^4]: from one point of 1 mm noise per 100 cm^2 to a million
// points of 1 um noise per mm^2. Smaller densities count as no information.
constexpr float kLogDensityMin = 18.42068f;  // ln 1e8
constexpr float kLogDensityMax = 55.26204f;  // ln 1e24
constexpr int kTableEntries = 257;
constexpr float kEntriesPerLogDensity = (kTableEntries - 1) / (kLogDensityMax - kLogDensityMin);
// Range of tabulated ratios of spacing to length scale; beyond, points are uninformative about the
// surface between them.
constexpr float kFirstSpacing = 0.5f, kLastSpacing = 4.0f;
constexpr float kEntriesPerSpacing = (kTableEntries - 1) / (kLastSpacing - kFirstSpacing);
constexpr int kRing = kProbesPerTarget - 1;

// Interpolates between evenly spaced entries at `place` (in entries); constant beyond the ends.
template <size_t N>
float Interpolate(const std::array<float, N>& entries, float place) {
  const float clamped = std::clamp(place, 0.0f, static_cast<float>(N - 1));
  const auto below = std::min(static_cast<size_t>(clamped), N - 2);
  return entries[below] +
         (clamped - static_cast<float>(below)) * (entries[below + 1] - entries[below]);
}

// Distance of the target from a straight border of the measured surface, if `unseen` of the kRing
// probes on the ring around it are not seen: an arc of 2 pi unseen / kRing lies beyond the border.
double BorderDistance(double ring_radius_m, double unseen) {
  return ring_radius_m * std::cos(std::numbers::pi * unseen / kRing);
}

std::vector<double> BorderDistances(const SurfacePrior& prior) {
  std::vector<double> distances;
  for (int unseen = kRing; unseen >= 0; --unseen) {
    distances.push_back(BorderDistance(prior.length_scale_m, unseen));
  }
  return distances;
}

}  // namespace

InformationTable::InformationTable(const SurfacePrior& prior,
                                   std::span<const double> border_distances_m) {
  const float step = (kLogDensityMax - kLogDensityMin) / (kEntries - 1);
  for (int i = 0; i < kEntries; ++i) {
    const double density = std::exp(kLogDensityMin + static_cast<float>(i) * step);
    log_variance_[i] = static_cast<float>(2 * std::log(UncertaintyAtDensity(prior, density)));
  }
  // Evenly spaced in the logarithm of the variance, from that at the largest density.
  log_variance_min_ = log_variance_[kEntries - 1];
  log_variance_step_ = (log_variance_[0] - log_variance_min_) / (kEntries - 1);
  for (int i = 0; i < kEntries; ++i) {
    const double u =
        std::exp(0.5 * (log_variance_min_ + static_cast<float>(i) * log_variance_step_));
    log_density_[i] = static_cast<float>(
        std::log(DensityForUncertainty(prior, std::min(u, prior.standard_deviation_m * 0.999999))));
  }
  const auto length_scale = static_cast<float>(prior.length_scale_m);
  per_spacing_ = kEntriesPerSpacing / length_scale;
  for (int i = 0; i < kEntries; ++i) {
    const float spacing = kFirstSpacing + static_cast<float>(i) / kEntriesPerSpacing;
    sampling_deviation_[i] =
        static_cast<float>(std::sqrt(SamplingVariance(prior, spacing * length_scale)));
  }
  for (const double distance_m : border_distances_m) {
    std::array<float, kEntries>& entries = log_border_density_.emplace_back();
    for (int i = 0; i < kEntries; ++i) {
      const float log_density = kLogDensityMin + static_cast<float>(i) * step;
      const double u = BorderUncertainty(prior, std::exp(log_density), distance_m);
      entries[i] = std::min(log_density, LogDensityFor(static_cast<float>(2 * std::log(u))));
    }
  }
}

float InformationTable::LogVarianceAt(float log_density) const {
  return Interpolate(log_variance_, (log_density - kLogDensityMin) * kEntriesPerLogDensity);
}

float InformationTable::LogDensityFor(float log_variance) const {
  return Interpolate(log_density_, (log_variance - log_variance_min_) / log_variance_step_);
}

float InformationTable::AtBorder(size_t i, float log_density) const {
  return Interpolate(log_border_density_[i],
                     (log_density - kLogDensityMin) * kEntriesPerLogDensity);
}

float InformationTable::SamplingVarianceAt(float spacing_m) const {
  const float place = spacing_m * per_spacing_ - kFirstSpacing * kEntriesPerSpacing;
  if (place <= 0) return 0;
  const float deviation_m = Interpolate(sampling_deviation_, place);
  return deviation_m * deviation_m;
}

InformationEstimator::InformationEstimator(const TargetSet& targets, const SurfaceProbes& probes,
                                           const TargetPriors& priors,
                                           const UncertaintyModel& model,
                                           std::vector<ExtentCost> extent_costs)
    : targets_(targets), priors_(priors), model_(model), extent_costs_(std::move(extent_costs)) {
  for (const SurfacePrior& prior : priors.priors) {
    tables_.emplace_back(prior, BorderDistances(prior));
    std::array<float, kExtentLevels.size()>& levels = level_log_variance_.emplace_back();
    for (size_t i = 0; i < levels.size(); ++i) {
      levels[i] = static_cast<float>(2 * std::log(kExtentLevels[i] * prior.standard_deviation_m));
    }
  }
  distinct_probes_.assign(targets.size(), 1);
  for (size_t t = 0; t < targets.size(); ++t) {
    for (int k = 1; k < kProbesPerTarget; ++k) {
      // Probes nearer to the target have slid inwards, because the surface ends there.
      constexpr double kNearRing = 0.75;
      const float distance_m =
          (probes.positions_m[t * kProbesPerTarget + k] - probes.positions_m[t * kProbesPerTarget])
              .norm();
      const bool on_ring = distance_m > kNearRing * priors.of(t).length_scale_m;
      distinct_probes_[t] |= static_cast<uint8_t>(on_ring << k);
    }
  }
}

void InformationEstimator::Estimate(const ScanInPart& scan, std::span<const SeenTarget> seen,
                                    std::span<float> information) const {
  const auto vector = [](const Eigen::Vector3d& v) { return Eigen::Vector3f(v.cast<float>()); };
  const Eigen::Vector3f camera = vector(scan.camera.origin_m), e = vector(scan.camera.x_axis),
                        y = vector(scan.camera.y_axis), w = vector(scan.camera.z_axis),
                        direction = vector(scan.scan_direction), n = vector(scan.sheet_normal),
                        gradient = vector(scan.lit_gradient);
  const auto offset = static_cast<float>(scan.lit_offset_m);
  const auto focal = static_cast<float>(scan.focal_length_px);
  const auto step = static_cast<float>(scan.scan_step_m * scan.sheet_normal_x);
  const float n_y = n.dot(y);
  const bool constant_noise = model_.detection.IsConstant();
  const auto constant_px = static_cast<float>(model_.detection.standard_deviations_px[0]);
  const CalibrationVariance calibration(scan, model_.calibration);
  for (size_t i = 0; i < seen.size(); ++i) {
    const size_t t = seen[i].target;
    information[i] = 0;
    const Eigen::Vector3f& p = targets_.positions_m[t];
    const Eigen::Vector3f& normal = targets_.normals[t];
    const float stage = gradient.dot(p) + offset;
    const Eigen::Vector3f view = p - camera + stage * direction;
    const float depth = view.dot(w);
    if (depth <= 0) continue;
    const Eigen::Vector3f ray = view / depth;
    const float slope = ray.dot(e);
    // Per area: one frame and one column. |t| = |n_t|, the part of the sheet's normal across N.
    const Eigen::Vector3f line = n.cross(normal);
    const float columns_per_length = focal * std::abs(line.dot(e) - slope * line.dot(w)) / depth;
    const float points_per_area = columns_per_length / step;
    // Displacements along the normal that detection errors along rows and columns cause.
    const float scale = depth / focal;
    const float by_row = scale * normal.dot(e);
    const float by_column = scale * (normal.dot(y) - normal.dot(ray) * n_y / n.dot(ray));
    float noise_px = constant_px;
    if (!constant_noise) {
      const float distance = view.norm();
      const float cosine = std::clamp(-view.dot(normal) / distance, -1.0f, 1.0f);
      noise_px = static_cast<float>(model_.detection.At(distance, std::acos(cosine)));
    }
    const float variance = noise_px * noise_px * (by_row * by_row + by_column * by_column);
    if (!(variance > 0) || !(points_per_area > 0)) continue;
    float log_density = std::log(points_per_area / variance);

    const uint16_t prior_index = priors_.prior_of[t];
    const InformationTable& table = tables_[prior_index];
    const uint8_t ring = distinct_probes_[t] >> 1;
    const int unseen = std::popcount(static_cast<uint8_t>(ring & ~(seen[i].probes >> 1)));
    const bool seen_itself = (seen[i].probes & 1) != 0;
    if (unseen > 0 || !seen_itself) {
      // A target that is seen itself is never beyond the border.
      constexpr int kOnBorder = kRing / 2 + 1;
      const int counted =
          seen_itself ? std::min(unseen, kOnBorder - 1) : std::max(unseen, kOnBorder);
      log_density = table.AtBorder(static_cast<size_t>(kRing - counted), log_density);
    }
    // Near the end of the surface, ln u grows by the cost, which is linear in ln u.
    const ExtentCost& cost = extent_costs_[t];
    if (cost[0] > 0 || cost[1] > 0) {
      const float log_variance = table.LogVarianceAt(log_density);
      const auto& levels = level_log_variance_[prior_index];
      const float level =
          std::clamp((log_variance - levels[0]) / (levels[1] - levels[0]), 0.0f, 1.0f);
      log_density = table.LogDensityFor(log_variance + 2 * (cost[0] + level * (cost[1] - cost[0])));
    }
    // Frames and columns may be so far apart that the surface can vary between them.
    const float tangential = line.norm();
    const float frames_apart = step / std::max(tangential, 1e-6f);
    const float columns_apart = tangential / std::max(columns_per_length, 1e-6f);
    float rest = table.SamplingVarianceAt(frames_apart) + table.SamplingVarianceAt(columns_apart);
    if (calibration.any()) rest += calibration.At(view, normal);
    if (rest > 0) {
      const float variance_m2 = std::exp(table.LogVarianceAt(log_density)) + rest;
      log_density = table.LogDensityFor(std::log(variance_m2));
    }
    const float density = std::exp(log_density);
    information[i] = density;
  }
}

}  // namespace sightline
