#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/inspection/domain_message.h"
#include "core/inspection/field_checks.h"

namespace sightline {
namespace {

constexpr double kTolerance = 1e-9;
constexpr double kTurn = 2 * std::numbers::pi;

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

v1::MeasurementDomain MeasurementDomainToProto(const MeasurementDomain& domain) {
  v1::MeasurementDomain message;
  // The message's first fields are the parameters, in their order.
  const auto* descriptor = v1::MeasurementDomain::descriptor();
  const bool resting = !domain.resting_orientations.empty();
  for (int i = 0; i < kMeasurementParameters; ++i) {
    const auto* field = descriptor->FindFieldByNumber(i + 1);
    // Neither angle may have a domain of its own beside the orientations.
    if (resting && (field->name() == "part_alpha_deg" || field->name() == "part_beta_deg")) {
      continue;
    }
    const bool angle = field->name().ends_with("_deg");
    const auto outside = [angle](double value) { return angle ? Degrees(value) : value; };
    auto& parameter = static_cast<v1::ParameterDomain&>(
        *message.GetReflection()->MutableMessage(&message, field));
    for (const double value : domain.parameters[i].values) parameter.add_values(outside(value));
    for (const ParameterDomain::Range& range : domain.parameters[i].ranges) {
      v1::ParameterDomain::Range& out = *parameter.add_ranges();
      out.set_min(outside(range.min));
      out.set_max(outside(range.max));
    }
  }
  for (const RestingOrientation& orientation : domain.resting_orientations) {
    v1::RestingOrientation& out = *message.add_resting_orientations();
    out.set_part_alpha_deg(Degrees(orientation.part_alpha_rad));
    out.set_part_beta_deg(Degrees(orientation.part_beta_rad));
  }
  return message;
}

}  // namespace sightline
