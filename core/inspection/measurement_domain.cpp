// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/field_limits/field_checks.h"
#include "core/inspection/inspection.h"
#include "core/json/error_list.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

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
  for (int i = 0; i < kMeasurementParameters; ++i) {
    if (!resting_orientations.empty() && (i == kPartAlpha || i == kPartBeta)) continue;
    if (!parameters[i].Contains(p[i])) return false;
  }
  if (resting_orientations.empty()) return true;
  if (!std::isfinite(p[kPartAlpha]) || !std::isfinite(p[kPartBeta])) return false;
  return std::any_of(resting_orientations.begin(), resting_orientations.end(),
                     [&](const RestingOrientation& o) {
                       return TurnDistance(p[kPartAlpha], o.part_alpha_rad) <= kTolerance &&
                              TurnDistance(p[kPartBeta], o.part_beta_rad) <= kTolerance;
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

LargestOffset LargestOffsetOf(double part_diameter_m) {
  constexpr int kY = 7, kZ = 8;
  const MeasurementDomain table_2_1 = ThesisDomain();
  const double y_m = table_2_1.parameters[kY].ranges[0].max,
               z_m = table_2_1.parameters[kZ].ranges[0].max;
  // The 1e-6 keeps whole numbers of centimetres from being rounded up.
  const double reach_m = std::ceil(100 * part_diameter_m - 1e-6) / 100;
  return {std::min(reach_m, y_m), std::min(reach_m, z_m), reach_m < std::max(y_m, z_m)};
}

namespace {

struct ParameterTable {
  const char* name;
  bool angle;     // degrees in the file
  bool periodic;  // [0, 360)
  // Table 2.1 in the unit of the file.
  std::vector<ParameterDomain::Range> bounds;
};

const std::vector<ParameterTable>& Table21() {
  static const std::vector<ParameterTable> table = {
      {"camera_distance_m", false, false, {{0.1, 0.8}}},
      {"triangulation_angle_deg", true, false, {{-80, -10}, {10, 80}}},
      {"camera_azimuth_deg", true, true, {{0, 360}}},
      {"camera_polar_deg", true, false, {{0, 90}}},
      {"part_alpha_deg", true, true, {{0, 360}}},
      {"part_beta_deg", true, true, {{0, 360}}},
      {"part_gamma_deg", true, true, {{0, 360}}},
      {"offset_y_m", false, false, {{-0.5, 0.5}}},
      {"offset_z_m", false, false, {{-0.4, 0.4}}},
  };
  return table;
}

// A single value of a periodic parameter is below 360; a range may end there.
std::string BoundsText(const ParameterTable& parameter, bool single_value) {
  return absl::StrCat(absl::StrJoin(parameter.bounds, " or ",
                                    [&](std::string* out, const ParameterDomain::Range& range) {
                                      const bool open = parameter.periodic && single_value;
                                      absl::StrAppend(out, "[", NumberText(range.min), ", ",
                                                      NumberText(range.max), open ? ")" : "]");
                                    }),
                      parameter.angle ? " deg" : " m");
}

absl::Status CheckParameterValue(const Checker& check, const std::string& path, double value,
                                 const ParameterTable& parameter) {
  for (const ParameterDomain::Range& bound : parameter.bounds) {
    if (value >= bound.min && (parameter.periodic ? value < bound.max : value <= bound.max)) {
      return absl::OkStatus();
    }
  }
  return check.Error(
      path, absl::StrCat("is ", NumberText(value), ", must be in ", BoundsText(parameter, true)));
}

absl::StatusOr<ParameterDomain> ParseParameterDomain(const v1::ParameterDomain& message,
                                                     const ParameterTable& parameter,
                                                     const std::string& path,
                                                     const Checker& check) {
  const auto internal = [&](double value) { return parameter.angle ? Radians(value) : value; };
  const int given = message.has_fixed() + !message.values().empty() + !message.ranges().empty();
  if (given != 1) {
    return check.Error(path, absl::StrCat("has ", given == 0 ? "none" : "several",
                                          " of fixed, values, ranges, must have exactly one"));
  }
  ParameterDomain domain;
  domain.periodic = parameter.periodic;
  if (message.has_fixed()) {
    SIGHTLINE_RETURN_IF_ERROR(
        CheckParameterValue(check, path + ".fixed", message.fixed(), parameter));
    domain.values = {internal(message.fixed())};
    return domain;
  }
  for (int i = 0; i < message.values_size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(CheckParameterValue(check, absl::StrCat(path, ".values[", i, "]"),
                                                  message.values(i), parameter));
    domain.values.push_back(internal(message.values(i)));
  }
  std::sort(domain.values.begin(), domain.values.end());
  domain.values.erase(std::unique(domain.values.begin(), domain.values.end()), domain.values.end());

  std::vector<ParameterDomain::Range> ranges;
  for (int i = 0; i < message.ranges_size(); ++i) {
    const std::string field = absl::StrCat(path, ".ranges[", i, "]");
    const double min = message.ranges(i).min(), max = message.ranges(i).max();
    if (min > max) {
      return check.Error(
          field, absl::StrCat("has min ", NumberText(min), " above max ", NumberText(max),
                              parameter.periodic ? "; give a range across 0 as two ranges" : ""));
    }
    const bool inside =
        std::any_of(parameter.bounds.begin(), parameter.bounds.end(),
                    [&](const ParameterDomain::Range& b) { return min >= b.min && max <= b.max; });
    if (!inside) {
      return check.Error(field, absl::StrCat("is [", NumberText(min), ", ", NumberText(max),
                                             "], must lie inside ", BoundsText(parameter, false)));
    }
    ranges.push_back({internal(min), internal(max)});
  }
  std::sort(ranges.begin(), ranges.end(), [](const auto& a, const auto& b) {
    return std::pair(a.min, a.max) < std::pair(b.min, b.max);
  });
  for (const ParameterDomain::Range& range : ranges) {
    if (!domain.ranges.empty() && range.min <= domain.ranges.back().max) {
      domain.ranges.back().max = std::max(domain.ranges.back().max, range.max);
    } else {
      domain.ranges.push_back(range);
    }
  }
  return domain;
}

}  // namespace

absl::StatusOr<MeasurementDomain> ParseMeasurementDomain(const v1::MeasurementDomain& message,
                                                         const std::string& context) {
  const Checker check(context);
  MeasurementDomain domain = ThesisDomain();
  const auto& table = Table21();
  const auto* descriptor = v1::MeasurementDomain::descriptor();
  const auto* reflection = message.GetReflection();
  ErrorList errors;
  for (int i = 0; i < kMeasurementParameters; ++i) {
    const auto* field = descriptor->FindFieldByName(table[i].name);
    if (!reflection->HasField(message, field)) continue;
    const auto& user =
        static_cast<const v1::ParameterDomain&>(reflection->GetMessage(message, field));
    absl::StatusOr<ParameterDomain> parsed =
        ParseParameterDomain(user, table[i], absl::StrCat("measurement.", table[i].name), check);
    if (errors.Add(parsed.status())) domain.parameters[i] = *std::move(parsed);
  }
  if (message.resting_orientations_size() > 0) {
    for (const auto& [given, name] : {std::pair(message.has_part_alpha_deg(), "part_alpha_deg"),
                                      std::pair(message.has_part_beta_deg(), "part_beta_deg")}) {
      if (given) {
        errors.Add(check.Error(absl::StrCat("measurement.", name),
                               "cannot be given together with measurement.resting_orientations"));
      }
    }
  }
  constexpr int kMaxRestingOrientations = 1000;
  if (message.resting_orientations_size() > kMaxRestingOrientations) {
    return check.Error("measurement.resting_orientations",
                       absl::StrCat("has ", message.resting_orientations_size(),
                                    " entries, at most ", kMaxRestingOrientations));
  }
  for (int i = 0; i < message.resting_orientations_size(); ++i) {
    const v1::RestingOrientation& o = message.resting_orientations(i);
    const std::string path = absl::StrCat("measurement.resting_orientations[", i, "]");
    errors.Add(CheckParameterValue(check, path + ".part_alpha_deg", o.part_alpha_deg(), table[4]));
    errors.Add(CheckParameterValue(check, path + ".part_beta_deg", o.part_beta_deg(), table[5]));
    domain.resting_orientations.push_back(
        {Radians(o.part_alpha_deg()), Radians(o.part_beta_deg()), o.name()});
  }
  if (!errors.empty()) return errors.Status();
  return domain;
}

v1::MeasurementDomain MeasurementDomainToProto(const MeasurementDomain& domain) {
  v1::MeasurementDomain message;
  const auto& table = Table21();
  const auto* descriptor = v1::MeasurementDomain::descriptor();
  const auto* reflection = message.GetReflection();
  for (int i = 0; i < kMeasurementParameters; ++i) {
    if (!domain.resting_orientations.empty() && (i == kPartAlpha || i == kPartBeta)) continue;
    const ParameterDomain& parameter = domain.parameters[i];
    const auto external = [&](double value) {
      // Degrees do not survive the way through radians and back bit by bit.
      return table[i].angle ? std::round(value * 180 / std::numbers::pi * 1e9) / 1e9 : value;
    };
    const auto single = [&](double value) {
      const double outside = external(value);
      return table[i].periodic && outside >= 360 ? 0.0 : outside;
    };
    auto& out = static_cast<v1::ParameterDomain&>(
        *reflection->MutableMessage(&message, descriptor->FindFieldByName(table[i].name)));
    for (const double value : parameter.values) out.add_values(single(value));
    for (const ParameterDomain::Range& range : parameter.ranges) {
      out.add_ranges()->set_min(external(range.min));
      out.mutable_ranges()->rbegin()->set_max(external(range.max));
    }
  }
  for (const RestingOrientation& orientation : domain.resting_orientations) {
    v1::RestingOrientation& out = *message.add_resting_orientations();
    out.set_part_alpha_deg(Degrees(orientation.part_alpha_rad));
    out.set_part_beta_deg(Degrees(orientation.part_beta_rad));
    out.set_name(orientation.name);
  }
  return message;
}

}  // namespace sightline
