// SPDX-License-Identifier: Apache-2.0
// The free parameters of a scan as coordinates of a unit cube, for optimisers.
#pragma once

#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/measurement.h"

namespace sightline {

// Maps the unit cube [0, 1]^dimension() onto a MeasurementDomain. Fixed parameters take no
// coordinate. A union of ranges is laid end to end on one coordinate (equal lengths of the union
// take equal lengths of the coordinate), a list of values takes equal cells, resting orientations
// take one coordinate in equal cells instead of alpha and beta. Angles whose range is a full turn
// wrap around; all other coordinates are clipped to [0, 1].
class SearchSpace {
 public:
  // Every parameter of the domain must have a range or a value (ParseInspection guarantees it).
  explicit SearchSpace(const MeasurementDomain& domain);

  int dimension() const { return static_cast<int>(axes_.size()); }
  // One element per coordinate: true if it wraps around.
  const std::vector<bool>& periodic() const { return periodic_; }

  // Any real coordinates; `unit` has dimension() elements. The result is inside the domain.
  Measurement ToMeasurement(std::span<const double> unit) const;

  // Coordinates in [0, 1] of the point of the domain nearest to the measurement, parameter by
  // parameter (cells: their middle). ToMeasurement inverts it for measurements inside the domain.
  std::vector<double> ToUnit(const Measurement& measurement) const;

  // The coordinates brought into [0, 1]: wrapped or clipped.
  std::vector<double> Normalise(std::span<const double> unit) const;

 private:
  struct Axis {
    // Index of the parameter, or kResting.
    int parameter;
    std::vector<ParameterDomain::Range> ranges;
    std::vector<double> values;
    double total_length = 0;
    bool periodic_values = false;
  };
  static constexpr int kResting = -1;

  std::array<double, kMeasurementParameters> fixed_{};
  std::vector<Axis> axes_;
  std::vector<bool> periodic_;
  std::vector<RestingOrientation> resting_;
};

}  // namespace sightline
