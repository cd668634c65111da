// SPDX-License-Identifier: Apache-2.0
#include "planning/optimise/search_space.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>

namespace sightline {

namespace {

constexpr double kTurn = 2 * std::numbers::pi;

double AngleDistance(double a, double b) { return std::abs(std::remainder(a - b, kTurn)); }

double Wrap(double u) {
  u -= std::floor(u);
  return u < 1 ? u : 0;  // -1e-20 wraps to 1.0 in floating point
}

size_t Cell(double u, size_t cells) {
  return std::min(cells - 1, static_cast<size_t>(u * static_cast<double>(cells)));
}

double CellCentre(size_t cell, size_t cells) {
  return (static_cast<double>(cell) + 0.5) / static_cast<double>(cells);
}

}  // namespace

SearchSpace::SearchSpace(const MeasurementDomain& domain) : resting_(domain.resting_orientations) {
  for (int i = 0; i < kMeasurementParameters; ++i) {
    if (!resting_.empty() && (i == kPartAlpha || i == kPartBeta)) continue;
    const ParameterDomain& parameter = domain.parameters[i];
    assert(!parameter.ranges.empty() || !parameter.values.empty());
    Axis axis{i, parameter.ranges, parameter.values, 0, parameter.periodic};
    for (const auto& range : axis.ranges) axis.total_length += range.max - range.min;
    if (!axis.ranges.empty() && axis.total_length <= 0) {
      // Ranges that are single points are a list of values.
      for (const auto& range : axis.ranges) axis.values.push_back(range.min);
      axis.ranges.clear();
    }
    fixed_[i] = axis.ranges.empty() ? axis.values.front() : axis.ranges.front().min;
    if (axis.ranges.empty() && axis.values.size() == 1) continue;
    periodic_.push_back(parameter.periodic && axis.ranges.size() == 1 &&
                        axis.total_length >= kTurn - 1e-9);
    axes_.push_back(std::move(axis));
  }
  if (resting_.size() == 1) {
    fixed_[kPartAlpha] = resting_[0].part_alpha_rad;
    fixed_[kPartBeta] = resting_[0].part_beta_rad;
  } else if (resting_.size() > 1) {
    axes_.push_back({kResting, {}, {}, 0, false});
    periodic_.push_back(false);
  }
}

std::vector<double> SearchSpace::Normalise(std::span<const double> unit) const {
  assert(static_cast<int>(unit.size()) == dimension());
  std::vector<double> result(unit.begin(), unit.end());
  for (size_t a = 0; a < result.size(); ++a) {
    result[a] = periodic_[a] ? Wrap(result[a]) : std::clamp(result[a], 0.0, 1.0);
  }
  return result;
}

Measurement SearchSpace::ToMeasurement(std::span<const double> unit) const {
  const std::vector<double> u = Normalise(unit);
  std::array<double, kMeasurementParameters> parameters = fixed_;
  for (size_t a = 0; a < axes_.size(); ++a) {
    const Axis& axis = axes_[a];
    if (axis.parameter == kResting) {
      const RestingOrientation& resting = resting_[Cell(u[a], resting_.size())];
      parameters[kPartAlpha] = resting.part_alpha_rad;
      parameters[kPartBeta] = resting.part_beta_rad;
    } else if (axis.ranges.empty()) {
      parameters[axis.parameter] = axis.values[Cell(u[a], axis.values.size())];
    } else {
      double rest = u[a] * axis.total_length;
      size_t r = 0;
      while (r + 1 < axis.ranges.size() && rest > axis.ranges[r].max - axis.ranges[r].min) {
        rest -= axis.ranges[r].max - axis.ranges[r].min;
        ++r;
      }
      const auto& range = axis.ranges[r];
      parameters[axis.parameter] = std::clamp(range.min + rest, range.min, range.max);
    }
  }
  return FromArray(parameters);
}

std::vector<double> SearchSpace::ToUnit(const Measurement& measurement) const {
  const std::array<double, kMeasurementParameters> parameters = ToArray(measurement);
  std::vector<double> unit(axes_.size());
  for (size_t a = 0; a < axes_.size(); ++a) {
    const Axis& axis = axes_[a];
    double best = std::numeric_limits<double>::infinity();
    const auto consider = [&](double distance, double u) {
      if (distance < best) {
        best = distance;
        unit[a] = u;
      }
    };
    if (axis.parameter == kResting) {
      for (size_t i = 0; i < resting_.size(); ++i) {
        consider(AngleDistance(parameters[kPartAlpha], resting_[i].part_alpha_rad) +
                     AngleDistance(parameters[kPartBeta], resting_[i].part_beta_rad),
                 CellCentre(i, resting_.size()));
      }
      continue;
    }
    const double value = parameters[axis.parameter];
    for (size_t i = 0; i < axis.values.size() && axis.ranges.empty(); ++i) {
      const double distance = axis.periodic_values ? AngleDistance(value, axis.values[i])
                                                   : std::abs(value - axis.values[i]);
      consider(distance, CellCentre(i, axis.values.size()));
    }
    double before = 0;
    for (const auto& range : axis.ranges) {
      // A periodic angle may be written in another turn than the range.
      for (int turn = axis.periodic_values ? -1 : 0; turn <= (axis.periodic_values ? 1 : 0);
           ++turn) {
        const double shifted = value + turn * kTurn;
        const double nearest = std::clamp(shifted, range.min, range.max);
        consider(std::abs(shifted - nearest), (before + nearest - range.min) / axis.total_length);
      }
      before += range.max - range.min;
    }
  }
  return Normalise(unit);
}

}  // namespace sightline
