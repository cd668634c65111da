// SPDX-License-Identifier: Apache-2.0
// Requests from the page of `sightline explore`: JSON objects, checked field by field.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/field_limits/field_checks.h"
#include "core/inspection/inspection.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

using Json = nlohmann::json;

// One of the nine parameters as shown to people.
struct ParameterDescription {
  const char* name;   // field of v1::Measurement: metres or degrees
  const char* label;  // for people
  bool angle;         // degrees; otherwise metres
};
// In the order of Measurement.
const std::array<ParameterDescription, kMeasurementParameters>& MeasurementParameters();

// Limits of the settings of camera and lens. As in the renderer, the focus distance is at least
// 1.01 focal lengths.
struct SettingLimits {
  Limits f_number, exposure_time_s, focus_distance_m;
};
SettingLimits LimitsOfSetting(const Lens& lens);

// Parses the body of a request. INVALID_ARGUMENT if it is no JSON object; numbers that overflow a
// double are rejected too.
absl::StatusOr<Json> ParseRequestBody(const std::string& body);

// Reads fields of one object; errors are collected, with field, value and allowed range.
class RequestReader {
 public:
  // `path`: of the object; empty or with a final dot. Fields that are not in `known` are errors.
  RequestReader(const Json& object, std::string path, std::initializer_list<const char*> known);

  // Value of the field, 0 if it is wrong. Unset optional fields: nullopt.
  double Number(const char* name, const Limits& limits);
  int64_t Integer(const char* name, int64_t min, int64_t max);
  std::optional<int64_t> OptionalInteger(const char* name, int64_t min, int64_t max);
  // Value of the field; false if it is missing.
  bool Flag(const char* name);
  // Value of the field, which must be one of `allowed`.
  std::string Word(const char* name, std::initializer_list<const char*> allowed);

  void Wrong(const std::string& field, const std::string& description) {
    violations_.push_back({path_ + field, description});
  }
  absl::Status status() const { return InvalidFields(violations_); }

 private:
  const Json* Find(const char* name, bool required);

  const Json& object_;
  const std::string path_;
  std::vector<FieldViolation> violations_;
};

// Reads the object `measurement` of a request: all nine parameters in metres and degrees, inside
// `domain`. Periodic angles are taken modulo a full turn. INVALID_ARGUMENT names field, value and
// allowed range.
absl::StatusOr<Measurement> ReadMeasurement(const Json& request, const MeasurementDomain& domain);

// Reads the object `setting` of a request: f_number, exposure_time_s, focus_distance_m. Other
// values, and all values without such an object, come from `base`.
absl::StatusOr<v1::OpticalSetting> ReadSetting(const Json& request, const SettingLimits& limits,
                                               const v1::OpticalSetting& base);

// {"camera_distance_m": 0.4, ...}: metres and degrees.
Json MeasurementJson(const Measurement& measurement);
Json SettingJson(const v1::OpticalSetting& setting);

// The allowed values of a parameter as text: "[0, 90] deg", "-30, 30 deg".
std::string AllowedText(const ParameterDomain& domain, bool angle);

}  // namespace sightline
