#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/inspection/inspection.h"

namespace sightline {
namespace {

constexpr double kTolerance = 1e-9;
constexpr double kTurn = 2 * std::numbers::pi;

double Radians(double degrees) { return degrees * std::numbers::pi / 180; }

// Distance of two angles along the shorter way round.
double TurnDistance(double a, double b) { return std::abs(std::remainder(a - b, kTurn)); }

}  // namespace

bool ParameterDomain::Contains(double value) const {
  if (!std::isfinite(value)) return false;
  for (double allowed : values) {
    if ((periodic ? TurnDistance(value, allowed) : std::abs(value - allowed)) <= kTolerance) {
      return true;
    }
  }
  for (const Range& range : ranges) {
    if (!periodic) {
      if (value >= range.min - kTolerance && value <= range.max + kTolerance) return true;
      continue;
    }
    const double middle = 0.5 * (range.min + range.max);
    const double half_width = 0.5 * (range.max - range.min);
    if (TurnDistance(value, middle) <= half_width + kTolerance) return true;
  }
  return false;
}

bool MeasurementDomain::Contains(const Measurement& measurement) const {
  const auto p = ToArray(measurement);
  constexpr int kAlpha = 4, kBeta = 5;
  for (int i = 0; i < kMeasurementParameters; ++i) {
    if (!resting_orientations.empty() && (i == kAlpha || i == kBeta)) continue;
    if (!parameters[i].Contains(p[i])) return false;
  }
  if (resting_orientations.empty()) return true;
  if (!std::isfinite(p[kAlpha]) || !std::isfinite(p[kBeta])) return false;
  return std::any_of(resting_orientations.begin(), resting_orientations.end(),
                     [&](const RestingOrientation& o) {
                       return TurnDistance(p[kAlpha], o.part_alpha_rad) <= kTolerance &&
                              TurnDistance(p[kBeta], o.part_beta_rad) <= kTolerance;
                     });
}

MeasurementDomain ThesisDomain() {
  const auto linear = [](std::vector<ParameterDomain::Range> ranges) {
    return ParameterDomain{.ranges = std::move(ranges), .values = {}, .periodic = false};
  };
  const ParameterDomain turn{.ranges = {{0, Radians(360)}}, .values = {}, .periodic = true};
  MeasurementDomain domain;
  domain.parameters = {linear({{0.1, 0.8}}),
                       linear({{Radians(-80), Radians(-10)}, {Radians(10), Radians(80)}}),
                       turn,
                       linear({{0, Radians(90)}}),
                       turn,
                       turn,
                       turn,
                       linear({{-0.5, 0.5}}),
                       linear({{-0.4, 0.4}})};
  return domain;
}

}  // namespace sightline
