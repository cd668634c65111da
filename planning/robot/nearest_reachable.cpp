// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/nearest_reachable.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/random/random.h"
#include "planning/optimise/search_space.h"

namespace sightline {
namespace {

constexpr int kPerDistance = 150;
constexpr int kNearestTried = 8;
constexpr int kHalvings = 8;
constexpr uint64_t kSeed = 7;

}  // namespace

std::optional<Measurement> NearestReachable(
    const RobotCell& cell, const MeasurementDomain& domain, const Measurement& measurement,
    const std::function<ScanTravel(const Measurement&)>& travel_of,
    const std::atomic<bool>* interrupted) {
  const SearchSpace space(domain);
  const std::vector<double> centre = space.ToUnit(measurement);
  const auto stopped = [&] { return interrupted != nullptr && *interrupted; };
  const auto reaches = [&](const std::vector<double>& unit) {
    const Measurement scan = space.ToMeasurement(unit);
    return cell.Reachable(scan, travel_of(scan), false).reachable();
  };
  if (reaches(centre)) return space.ToMeasurement(centre);  // it lay outside the domain
  Random random(kSeed);
  std::optional<std::vector<double>> nearest;
  double nearest_distance = 2;
  const auto distance_of = [&](const std::vector<double>& unit) {
    double sum = 0;
    for (size_t i = 0; i < unit.size(); ++i) {
      double d = unit[i] - centre[i];
      if (space.periodic()[i]) d = std::remainder(d, 1.0);
      sum += d * d;
    }
    return std::sqrt(sum);
  };
  for (double radius = 0.01; radius < 1 && !nearest; radius *= 1.6) {
    std::vector<std::pair<double, std::vector<double>>> reached;
    for (int n = 0; n < kPerDistance && !stopped(); ++n) {
      std::vector<double> unit = centre;
      double length = 0;
      std::vector<double> direction(unit.size());
      for (double& d : direction) {
        d = random.Normal();
        length += d * d;
      }
      const double step = radius * std::sqrt(random.Uniform()) / std::sqrt(std::max(length, 1e-12));
      for (size_t i = 0; i < unit.size(); ++i) unit[i] += step * direction[i];
      unit = space.Normalise(unit);
      if (reaches(unit)) reached.emplace_back(distance_of(unit), unit);
    }
    if (stopped()) return std::nullopt;
    std::sort(reached.begin(), reached.end());
    if (reached.size() > kNearestTried) reached.resize(kNearestTried);
    for (auto& [distance, unit] : reached) {
      // Bisection between a reachable and an unreachable scan.
      double in = 1, out = 0;
      std::vector<double> best = unit;
      for (int k = 0; k < kHalvings && !stopped(); ++k) {
        const double t = (in + out) / 2;
        std::vector<double> trial = centre;
        for (size_t i = 0; i < trial.size(); ++i) {
          double d = unit[i] - centre[i];
          if (space.periodic()[i]) d = std::remainder(d, 1.0);
          trial[i] += t * d;
        }
        trial = space.Normalise(trial);
        if (reaches(trial)) {
          in = t;
          best = trial;
        } else {
          out = t;
        }
      }
      if (const double d = distance_of(best); d < nearest_distance) {
        nearest_distance = d;
        nearest = best;
      }
    }
  }
  if (!nearest) return std::nullopt;
  return space.ToMeasurement(*nearest);
}

std::string DifferenceText(const Measurement& scan, const Measurement& other) {
  const auto here = ToArray(scan), there = ToArray(other);
  std::string text;
  for (size_t p = 0; p < here.size(); ++p) {
    if (std::abs(here[p] - there[p]) < 1e-6) continue;
    const bool angle = p >= 1 && p <= 6;
    absl::StrAppend(&text, text.empty() ? "" : ", ", kMeasurementParameterNames[p], " ",
                    angle ? absl::StrFormat("%.2f", here[p] * 180 / std::numbers::pi)
                          : absl::StrFormat("%.4f", here[p]));
  }
  return text;
}

}  // namespace sightline
