// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_model.h"

#include <cmath>

#include "core/statistics/square.h"

namespace sightline {
namespace {

// Photon numbers that are written as whole numbers have a uniform error of width one.
const double kRoundingDeviation_photons = 1 / std::sqrt(12.0);

}  // namespace

TransferMoments ExpectedMoments(const TransferObservations& data, const TransferLayout& layout,
                                const Eigen::VectorXd& scaled) {
  const auto at = [&](int k) { return k < 0 ? 0.0 : scaled[k] * layout.scale[k]; };
  const double gain = at(layout.gain), b_2 = at(layout.quadratic), b_3 = at(layout.cubic);
  const double time_offset_s = at(layout.time_offset), stray = at(layout.stray);
  const double brighter_fatter = at(layout.brighter_fatter);
  TransferMoments expected{Eigen::VectorXd(data.size()), Eigen::VectorXd(data.size())};
  for (Eigen::Index i = 0; i < data.size(); ++i) {
    const FlatFieldStatistics& step = *data.steps[i];
    double photons = data.photons[i];
    if (!step.dark) {
      if (step.exposure_time_s > 0) photons *= 1 + time_offset_s / step.exposure_time_s;
      photons += stray;
    }
    const double electrons =
        at(layout.efficiency) * photons + at(layout.dark_current) * step.exposure_time_s;
    const double u = electrons / data.saturation_electrons;
    expected.mean_dn[i] = at(layout.black_level) + gain * electrons * (1 + b_2 * u + b_3 * u * u);
    const double slope = gain * (1 + 2 * b_2 * u + 3 * b_3 * u * u);
    expected.variance_dn2[i] =
        slope * slope * (electrons * (1 - brighter_fatter * u) + at(layout.dark_variance)) +
        kQuantisationVariance_dn2;
  }
  return expected;
}

Eigen::VectorXd StandardDeviations(const TransferObservations& data,
                                   const BetweenStepDeviation& between_steps) {
  const Eigen::Index n = data.size();
  Eigen::VectorXd deviation(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double signal = std::abs(data.mean_dn[i] - data.black_level_dn);
    const FlatFieldStatistics& step = *data.steps[i];
    double variance =
        Square(data.noise_of_mean_dn[i]) + Square(data.black_level_deviation_dn) / step.frames();
    if (!step.dark) {
      variance += Square(between_steps.light * signal);
      if (data.whole_photons && data.photons[i] > 0) {
        variance += Square(signal * kRoundingDeviation_photons / data.photons[i]);
      }
    }
    deviation[i] = std::sqrt(variance);
    deviation[n + i] =
        std::hypot(data.noise_of_variance_dn2[i], between_steps.variance * data.variance_dn2[i]);
  }
  return deviation;
}

}  // namespace sightline
