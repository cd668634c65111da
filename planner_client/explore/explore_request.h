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

// One of the nine parameters, as people see it.
struct ParameterDescription {
  const char* name;   // field of v1::Measurement: metres or degrees
  const char* label;  // for people
  bool angle;         // degrees; otherwise metres
};
// In the order of Measurement.
const std::array<ParameterDescription, kMeasurementParameters>& MeasurementParameters();

// Limits of the settings of camera and lens. The focus distance is at least
// 1.01 focal lengths, as the renderer has it.
struct SettingLimits {
  Limits f_number, exposure_time_s, focus_distance_m;
};
SettingLimits LimitsOfSetting(const Lens& lens);

// Body of a request. INVALID_ARGUMENT: no JSON object (numbers too large for a double are none).
absl::StatusOr<Json> ParseRequestBody(const std::string& body);

// Reads fields of one object; errors are collected, with field, value and allowed range.
class RequestReader {
 public:
  // `path`: of the object, "" or ending with a dot. Fields that are not `known` are wrong.
  RequestReader(const Json& object, std::string path, std::initializer_list<const char*> known);

  // The field's number; 0 if it is wrong. Unset optional fields: nullopt.
  double Number(const char* name, const Limits& limits);
  int64_t Integer(const char* name, int64_t min, int64_t max);
  std::optional<int64_t> OptionalInteger(const char* name, int64_t min, int64_t max);
  // False if it is not there.
  bool Flag(const char* name);
  // One of `allowed`.
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

// The object `measurement` of a request: all nine parameters in metres and degrees, inside
// `domain`. Angles that wrap around are taken modulo a full turn. INVALID_ARGUMENT names field,
// value and allowed range.
absl::StatusOr<Measurement> ReadMeasurement(const Json& request, const MeasurementDomain& domain);

// The object `setting` of a request: f_number, exposure_time_s, focus_distance_m; the rest is that
// of `base`. Without such an object: `base`.
absl::StatusOr<v1::OpticalSetting> ReadSetting(const Json& request, const SettingLimits& limits,
                                               const v1::OpticalSetting& base);

// {"camera_distance_m": 0.4, ...}: metres and degrees.
Json MeasurementJson(const Measurement& measurement);
Json SettingJson(const v1::OpticalSetting& setting);

// The allowed values of a parameter as text: "[0, 90] deg", "-30, 30 deg".
std::string AllowedText(const ParameterDomain& domain, bool angle);

}  // namespace sightline
