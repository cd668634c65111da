// SPDX-License-Identifier: Apache-2.0
// Light at another wavelength, excited by the laser: the line's own profile without speckle. Its
// strength is the ratio of what a sensor sees of it to what it sees of the laser, so photons count
// as those of the laser's wavelength. The plate's other light is sampled a pixel apart and without
// defocus, so this radiance is spread over pixel and circle of confusion here (geometric optics,
// across the line only: along it nothing changes).
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/plate_profile.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

// Weights of a line spread of a disc of radius `disc_m` (half ellipse), convolved with a box of
// width `box_m`; sum 1 (both sides). Integrals of the half ellipse in closed form.
std::vector<double> DiscAndBox(double disc_m, double box_m, double step_m) {
  const auto below = [&](double s) {  // share of the disc left of s
    const double t = std::clamp(s / disc_m, -1.0, 1.0);
    return 0.5 + (t * std::sqrt(1 - t * t) + std::asin(t)) / std::numbers::pi;
  };
  const auto reach = static_cast<size_t>((disc_m + 0.5 * box_m) / step_m) + 2;
  std::vector<double> weights(reach);
  double sum = 0;
  for (size_t k = 0; k < reach; ++k) {
    const double s = static_cast<double>(k) * step_m;
    weights[k] = disc_m > 0 ? below(s + 0.5 * box_m) - below(s - 0.5 * box_m)
                            : std::clamp((0.5 * box_m - s) / step_m + 0.5, 0.0, 1.0);
    sum += (k == 0 ? 1 : 2) * weights[k];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

class FluorescenceEffect final : public DescribedEffect {
 public:
  FluorescenceEffect()
      : DescribedEffect({.id = "surface.fluorescence",
                         .stage = Stage::kSurface,
                         .signature = {{"line_core", "whole_image"}, {"signal_level"}},
                         .scope = EffectScope::kFlatPlate,
                         .summary =
                             "light of another wavelength without speckle, a fraction of the "
                             "laser's signal",
                         .reference = "Lakowicz, Principles of Fluorescence Spectroscopy, 3rd ed., "
                                      "chapter 1",
                         .parameters = {{"fluorescence_relative", 0, 0, 2, 0.1}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0 || !frame.laser_on) return;  // an empty function stays empty
    const double b = frame.ImageDistance();
    const double distance = frame.plate.camera_distance_m;
    const double pixel_m = frame.sensor.pixel_pitch_m * distance / b;
    const double focus = 1 / (1 / frame.lens.focal_length_m - 1 / distance);
    const double confusion_m =
        0.5 * frame.PupilDiameter() * std::abs(1 / focus - 1 / b) * distance;  // on the plate
    const double line_m = BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                          std::cos(frame.plate.incidence_angle_rad);
    const PlateFunction radiance = [strength = p[0], irradiance = scene.laser_irradiance_w_m2,
                                    brdf = scene.brdf_per_sr](double x_m, double s_m) {
      return strength * irradiance(x_m, s_m) * brdf(x_m, s_m);
    };
    auto spread = std::make_shared<PlateProfile>(radiance, frame, scene.constant_along_line,
                                                 std::min(line_m, 2 * pixel_m));
    spread->SpreadBy(DiscAndBox(confusion_m, pixel_m, spread->step_m()));
    scene.ambient_radiance_w_m2_sr = [spread, before = std::move(scene.ambient_radiance_w_m2_sr)](
                                         double x_m, double s_m) {
      return (before ? before(x_m, s_m) : 0.0) + spread->At(x_m, s_m);
    };
  }
};

}  // namespace

const Effect& Fluorescence() {
  static const FluorescenceEffect effect;
  return effect;
}

}  // namespace sightline
