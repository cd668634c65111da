// SPDX-License-Identifier: Apache-2.0
// The diagnosis of a camera, sorted for its report.
#pragma once

#include <string>
#include <vector>

#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// Holds references: the diagnosis must outlive it.
struct SensorView {
  explicit SensorView(const v1::SensorDiagnosis& of);

  const v1::SensorDiagnosis& diagnosis;
  std::vector<const v1::SensorDeparture*> found, absent, not_testable;
  // Steps below saturation with a finite signal, sorted by signal; and saturated steps.
  std::vector<const v1::PhotonTransferPoint*> points, saturated;
  bool has_model = false;  // a departure was found
};

// Readable unit of a quantity or parameter: "e-" and "DN^2" with their signs, plain fractions in
// per cent.
struct SensorUnit {
  double per_named = 1;
  std::string name;  // without a space before it
};
SensorUnit SensorUnitOf(const std::string& name, const std::string& unit);

}  // namespace sightline
