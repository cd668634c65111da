// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/frames/shared_noise.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/statistics/normal_distribution.h"
#include "render_worker/sensor_diagnosis/departure_names.h"
#include "render_worker/sensor_diagnosis/frames/temporal_variance.h"

namespace sightline {
namespace {

// Smallest variance of lines over that of pixels, and smallest correlation of neighbours, that
// matter. Chosen.
constexpr double kMaterialLineNoise = 0.01, kMaterialCorrelation = 2e-3;
// Smallest reciprocal condition number of the normal equations of the quadratic.
constexpr double kLeastCouplingCondition = 1e-12;

// c_0 + c_1 u + c_2 u^2 with u = signal / largest signal [DN^2].
struct CovarianceCurve {
  Eigen::Vector3d coefficients;
  Eigen::Matrix3d covariance;
};

// Weighted least squares of the covariance of neighbours; unset if the steps do not determine it.
std::optional<CovarianceCurve> FitCovariance(std::span<const FlatFieldStatistics* const> steps,
                                             std::span<const double> signal_dn,
                                             double largest_signal_dn, bool in_row) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < steps.size(); ++i) {
    const TemporalNoise& noise = steps[i]->noise;
    const Estimate& covariance =
        in_row ? noise.covariance_in_row_dn2 : noise.covariance_in_column_dn2;
    // The standard error from parts of the image may be small by chance; white noise gives its
    // least value.
    const double error = std::max(covariance.standard_error,
                                  TemporalVariance(*steps[i]) / std::sqrt(steps[i]->pair.pixels));
    const double u = signal_dn[i] / largest_signal_dn;
    const Eigen::Vector3d row(1, u, u * u);
    normal += row * row.transpose() / Square(error);
    right += row * covariance.value / Square(error);
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
  if (solver.info() != Eigen::Success || solver.rcond() < kLeastCouplingCondition) {
    return std::nullopt;
  }
  return CovarianceCurve{solver.solve(right), solver.solve(Eigen::Matrix3d::Identity())};
}

// The correlation by the term of order `k` at a pixel variance of `variance`. `detail` ends the
// description.
Departure CouplingOfOrder(const CovarianceCurve& curve, int k, double variance, bool in_row,
                          Departure departure, const char* detail) {
  const double correlation = curve.coefficients[k] / variance;
  const double error = std::sqrt(curve.covariance(k, k)) / variance;
  departure.description = absl::StrFormat("noise of neighbours %s is correlated by %.3g %s",
                                          in_row ? "in a row" : "in a column", correlation, detail);
  departure.p_value = NormalTwoSidedTail(correlation / error);
  departure.material = std::abs(correlation) > kMaterialCorrelation;
  departure.parameters.push_back(
      {in_row ? "correlation_in_row" : "correlation_in_column", "", correlation, error});
  return departure;
}

}  // namespace

std::vector<Departure> LineNoiseDepartures(std::span<const FlatFieldStatistics* const> dark) {
  std::vector<Departure> departures;
  for (const bool rows : {true, false}) {
    WeightedMean variance, pixel;
    for (const FlatFieldStatistics* step : dark) {
      const Estimate& line = rows ? step->noise.row_variance_dn2 : step->noise.column_variance_dn2;
      variance.Add(line.value, line.standard_error);
      pixel.Add(TemporalVariance(*step), 1);
    }
    if (variance.weight == 0) continue;
    const double value = variance.Mean();
    const double strength = std::sqrt(std::max(0.0, value));
    Departure departure{
        .effect = rows ? NamesInVocabulary().row_noise : std::string(kColumnNoise),
        .stage = "readout",
        .description = absl::StrFormat(
            "all pixels of a %s share noise of %.3g DN (standard deviation) that changes from "
            "frame to frame",
            rows ? "row" : "column", strength),
        .p_value = NormalUpperTail(value / variance.Error()),
        .material = value > kMaterialLineNoise * pixel.Mean()};
    departure.parameters.push_back(
        {"standard_deviation", "DN", strength,
         variance.Error() / std::max(2 * strength, std::sqrt(variance.Error()))});
    departures.push_back(std::move(departure));
  }
  return departures;
}

std::vector<Departure> NeighbourDepartures(std::span<const FlatFieldStatistics* const> steps,
                                           std::span<const double> signal_dn) {
  std::vector<Departure> departures;
  double largest = 0, dark_variance = 0, brightest_variance = 0;
  for (size_t i = 0; i < steps.size(); ++i) {
    if (steps[i]->dark) dark_variance = std::max(dark_variance, TemporalVariance(*steps[i]));
    if (signal_dn[i] > largest) {
      largest = signal_dn[i];
      brightest_variance = TemporalVariance(*steps[i]);
    }
  }
  if (largest <= 0 || brightest_variance <= 0) return departures;
  for (const bool in_row : {true, false}) {
    const auto curve = FitCovariance(steps, signal_dn, largest, in_row);
    if (!curve) continue;
    const std::string direction = in_row ? "_in_row" : "_in_column";
    if (dark_variance > 0) {
      departures.push_back(CouplingOfOrder(
          *curve, 0, dark_variance, in_row,
          {.effect = std::string(kReadoutCorrelation) + direction, .stage = "readout"},
          "in the dark"));
    }
    departures.push_back(CouplingOfOrder(
        *curve, 1, brightest_variance, in_row,
        {.effect = std::string(kInterpixelCoupling) + direction, .stage = "sensor"},
        "in proportion to the signal: a part of each pixel's signal is added to its neighbour's "
        "after the electrons are counted"));
    departures.push_back(CouplingOfOrder(
        *curve, 2, brightest_variance, in_row,
        {.effect = NamesInVocabulary().brighter_fatter, .stage = "sensor"},
        "at the largest signal, growing with its square: charge pushes charge into the neighbour"));
  }
  return departures;
}

}  // namespace sightline
