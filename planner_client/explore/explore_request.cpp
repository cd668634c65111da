// SPDX-License-Identifier: Apache-2.0
#include "planner_client/explore/explore_request.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr double kTurn_rad = 2 * std::numbers::pi;
constexpr size_t kShownText = 60;

// A value as it came, for a message.
std::string Shown(const Json& value) {
  std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
  if (text.size() > kShownText) text = text.substr(0, kShownText) + "...";
  return text;
}

double OutsideValue(double inside, bool angle) { return angle ? Degrees(inside) : inside; }

}  // namespace

const std::array<ParameterDescription, kMeasurementParameters>& MeasurementParameters() {
  static constexpr std::array<ParameterDescription, kMeasurementParameters> kParameters = {{
      {"camera_distance_m", "Camera distance", false},
      {"triangulation_angle_deg", "Triangulation angle", true},
      {"camera_azimuth_deg", "Camera azimuth", true},
      {"camera_polar_deg", "Camera polar angle", true},
      {"part_alpha_deg", "Part turn α about x", true},
      {"part_beta_deg", "Part turn β about y", true},
      {"part_gamma_deg", "Part turn γ about z", true},
      {"offset_y_m", "Part offset y", false},
      {"offset_z_m", "Part offset z", false},
  }};
  return kParameters;
}

SettingLimits LimitsOfSetting(const Lens& lens) {
  return {
      .f_number = {lens.min_f_number.value_or(0.5), lens.max_f_number.value_or(128), ""},
      .exposure_time_s = {0, 100, " s", true},
      .focus_distance_m = {
          std::max(lens.min_focus_distance_m.value_or(0), 1.01 * lens.focal_length_m), 1000, " m"}};
}

absl::StatusOr<Json> ParseRequestBody(const std::string& body) {
  // Requests are three deep. Values are shown in messages, which the library writes by recursion.
  constexpr int kMostDepth = 16;
  bool too_deep = false;
  Json request = Json::parse(
      body,
      [&too_deep](int depth, Json::parse_event_t, Json&) {
        too_deep = too_deep || depth > kMostDepth;
        return !too_deep;
      },
      /*allow_exceptions=*/false);
  if (too_deep) {
    return absl::InvalidArgumentError(
        absl::StrCat("the request's body is nested deeper than ", kMostDepth, " levels"));
  }
  if (!request.is_object()) {
    return absl::InvalidArgumentError("the request's body must be a JSON object");
  }
  return request;
}

RequestReader::RequestReader(const Json& object, std::string path,
                             std::initializer_list<const char*> known)
    : object_(object), path_(std::move(path)) {
  for (const auto& entry : object.items()) {
    const bool is_known = std::any_of(known.begin(), known.end(),
                                      [&](const char* name) { return entry.key() == name; });
    if (!is_known) Wrong(entry.key().substr(0, kShownText), "is not known");
  }
}

const Json* RequestReader::Find(const char* name, bool required) {
  const auto entry = object_.find(name);
  if (entry != object_.end() && !entry->is_null()) return &*entry;
  if (required) Wrong(name, "is missing");
  return nullptr;
}

double RequestReader::Number(const char* name, const Limits& limits) {
  const Json* value = Find(name, true);
  if (value == nullptr) return 0;
  if (value->is_number() && limits.Contains(value->get<double>())) return value->get<double>();
  Wrong(name, absl::StrCat("is ", Shown(*value), ", must be a number in ", limits.ToString()));
  return 0;
}

int64_t RequestReader::Integer(const char* name, int64_t min, int64_t max) {
  if (Find(name, true) == nullptr) return 0;
  return OptionalInteger(name, min, max).value_or(0);
}

std::optional<int64_t> RequestReader::OptionalInteger(const char* name, int64_t min, int64_t max) {
  const Json* value = Find(name, false);
  if (value == nullptr) return std::nullopt;
  // Numbers above the range of int64 are unsigned or floating there.
  if (value->is_number_integer() &&
      !(value->is_number_unsigned() && value->get<uint64_t>() > static_cast<uint64_t>(INT64_MAX))) {
    const auto number = value->get<int64_t>();
    if (number >= min && number <= max) return number;
  }
  if (max < min) {
    Wrong(name, absl::StrCat("is ", Shown(*value), ", but there is nothing to choose from"));
  } else {
    Wrong(name,
          absl::StrCat("is ", Shown(*value), ", must be a whole number in [", min, ", ", max, "]"));
  }
  return std::nullopt;
}

bool RequestReader::Flag(const char* name) {
  const Json* value = Find(name, false);
  if (value == nullptr) return false;
  if (value->is_boolean()) return value->get<bool>();
  Wrong(name, absl::StrCat("is ", Shown(*value), ", must be true or false"));
  return false;
}

std::string RequestReader::Word(const char* name, std::initializer_list<const char*> allowed) {
  const Json* value = Find(name, true);
  if (value == nullptr) return "";
  std::string words;
  for (const char* word : allowed) {
    if (value->is_string() && value->get<std::string>() == word) return word;
    absl::StrAppend(&words, words.empty() ? "" : ", ", word);
  }
  Wrong(name, absl::StrCat("is ", Shown(*value), ", must be one of ", words));
  return "";
}

std::string AllowedText(const ParameterDomain& domain, bool angle) {
  std::string text;
  for (const ParameterDomain::Range& range : domain.ranges) {
    absl::StrAppend(&text, text.empty() ? "" : " or ", "[",
                    NumberText(OutsideValue(range.min, angle)), ", ",
                    NumberText(OutsideValue(range.max, angle)), "]");
  }
  for (const double value : domain.values) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", NumberText(OutsideValue(value, angle)));
  }
  return absl::StrCat(text, angle ? " deg" : " m");
}

absl::StatusOr<Measurement> ReadMeasurement(const Json& request, const MeasurementDomain& domain) {
  const auto entry = request.find("measurement");
  if (entry == request.end() || !entry->is_object()) {
    return InvalidFields({{"measurement", "must be an object with the nine parameters"}});
  }
  RequestReader reader(
      *entry, "measurement.",
      {"camera_distance_m", "triangulation_angle_deg", "camera_azimuth_deg", "camera_polar_deg",
       "part_alpha_deg", "part_beta_deg", "part_gamma_deg", "offset_y_m", "offset_z_m"});
  // Limits of every parameter; those of the domain are checked afterwards.
  constexpr Limits kAnyNumber{-1e6, 1e6, ""};
  std::array<double, kMeasurementParameters> values{};
  const auto& parameters = MeasurementParameters();
  for (int i = 0; i < kMeasurementParameters; ++i) {
    const ParameterDescription& parameter = parameters[i];
    const ParameterDomain& allowed = domain.parameters[i];
    const double outside = reader.Number(parameter.name, kAnyNumber);
    values[i] = parameter.angle ? Radians(outside) : outside;
    if (allowed.periodic && !(values[i] >= 0 && values[i] < kTurn_rad)) {
      values[i] = std::fmod(std::fmod(values[i], kTurn_rad) + kTurn_rad, kTurn_rad);
    }
    const bool resting = !domain.resting_orientations.empty() && (i == 4 || i == 5);
    if (!resting && !allowed.Contains(values[i])) {
      reader.Wrong(parameter.name, absl::StrCat("is ", NumberText(outside), ", must be in ",
                                                AllowedText(allowed, parameter.angle)));
    }
  }
  const Measurement measurement = FromArray(values);
  SIGHTLINE_RETURN_IF_ERROR(reader.status());
  if (!domain.Contains(measurement)) {
    return InvalidFields({{"measurement.part_alpha_deg",
                           "and part_beta_deg must be one of the inspection's resting "
                           "orientations"}});
  }
  return measurement;
}

absl::StatusOr<v1::OpticalSetting> ReadSetting(const Json& request, const SettingLimits& limits,
                                               const v1::OpticalSetting& base) {
  v1::OpticalSetting setting = base;
  const auto entry = request.find("setting");
  if (entry == request.end() || entry->is_null()) return setting;
  if (!entry->is_object()) return InvalidFields({{"setting", "must be an object"}});
  RequestReader reader(*entry, "setting.", {"f_number", "exposure_time_s", "focus_distance_m"});
  setting.set_f_number(reader.Number("f_number", limits.f_number));
  setting.set_exposure_time_s(reader.Number("exposure_time_s", limits.exposure_time_s));
  setting.set_focus_distance_m(reader.Number("focus_distance_m", limits.focus_distance_m));
  SIGHTLINE_RETURN_IF_ERROR(reader.status());
  return setting;
}

Json MeasurementJson(const Measurement& measurement) {
  Json json = Json::object();
  const auto values = ToArray(measurement);
  const auto& parameters = MeasurementParameters();
  for (int i = 0; i < kMeasurementParameters; ++i) {
    json[parameters[i].name] = OutsideValue(values[i], parameters[i].angle);
  }
  return json;
}

Json SettingJson(const v1::OpticalSetting& setting) {
  return {{"f_number", setting.f_number()},
          {"exposure_time_s", setting.exposure_time_s()},
          {"focus_distance_m", setting.focus_distance_m()}};
}

}  // namespace sightline
