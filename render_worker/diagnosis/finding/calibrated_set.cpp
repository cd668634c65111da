// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/calibrated_set.h"

#include <algorithm>
#include <cmath>

namespace sightline {

RecordingSet CalibratedSet(const RecordingSet& nominal, const FitResult& fit) {
  RecordingSet set = nominal;
  const SetupDeviation d = fit.parameters.deviations;
  for (QuantumEfficiencyCurve& curve : set.camera.quantum_efficiency) {
    for (double& value : curve.quantum_efficiency) {
      value = std::min(1.0, value * (1 + d.quantum_efficiency_relative));
    }
  }
  set.camera.gain_dn_per_electron *= 1 + d.gain_relative;
  set.camera.dark_mean_electrons =
      std::max(0.0, set.camera.dark_mean_electrons + d.dark_mean_electrons);
  set.camera.dark_noise_electrons *= 1 + d.dark_noise_relative;
  set.transmission = std::min(1.0, set.transmission * (1 + d.transmission_relative));
  set.laser.power_w *= 1 + PowerDeviation(nominal.uncertainty, d.power_relative);
  set.laser.divergence_rad *= 1 + d.divergence_relative;
  set.laser.beam_focus_distance_m += d.beam_focus_distance_m;
  set.surface.diffuse_albedo =
      std::min(1.0, set.surface.diffuse_albedo * (1 + d.diffuse_albedo_relative));
  set.surface.specular_f0 = std::min(1.0, set.surface.specular_f0 * (1 + d.specular_f0_relative));
  set.surface.ggx_alpha = std::min(1.0, set.surface.ggx_alpha * (1 + d.ggx_alpha_relative));
  set.incidence_angle_rad += d.incidence_angle_rad;
  for (RecordedImage& image : set.recordings) {
    image.camera_distance_m += d.camera_distance_m;
    image.laser_distance_m += d.laser_distance_m;
    image.focus_distance_m *= 1 + d.focus_distance_relative;
    image.f_number *= 1 + d.f_number_relative;
  }
  int column = 0;
  for (int i = 0; i < kDeviations; ++i) {
    double& uncertainty = DeviationAt(set.uncertainty, i);
    if (uncertainty <= 0) continue;
    uncertainty *= std::sqrt(fit.covariance(column, column));
    ++column;
  }
  return set;
}

}  // namespace sightline
