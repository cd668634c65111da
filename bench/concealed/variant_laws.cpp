// SPDX-License-Identifier: Apache-2.0
#include "bench/concealed/variant_laws.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/independent_patterns.h"

namespace sightline::bench {
namespace {

using std::numbers::pi;

double FullScaleElectrons(const FrameSetup& frame) {
  return frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron;
}

// --- illumination -------------------------------------------------------------------------------

class LinearDrift final : public DescribedEffect {
 public:
  LinearDrift()
      : DescribedEffect({.id = "variant.linear_power_drift",
                         .stage = Stage::kIllumination,
                         .summary = "power P (1 + a t/1500 s) instead of an exponential",
                         .reference = "ISO 11554:2017 (stability of laser power)",
                         .parameters = {{"drift_relative", 0, -0.9, 5, 0.1}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.power_w *= 1 + p[0] * frame.timestamp_s / 1500;
  }
};

class PowerStep final : public DescribedEffect {
 public:
  PowerStep()
      : DescribedEffect({.id = "variant.power_step",
                         .stage = Stage::kIllumination,
                         .summary = "power jumps by a factor 1 + a at a moment (mode hop)",
                         .reference = "ISO 11554:2017 (stability of laser power)",
                         .parameters = {{"step_relative", 0, -0.9, 5, 0.1},
                                        {"step_time_s", 700, 0, 1e5, 600}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    if (frame.timestamp_s > p[1]) frame.laser.power_w *= 1 + p[0];
  }
};

class PowerOscillation final : public DescribedEffect {
 public:
  PowerOscillation()
      : DescribedEffect({.id = "variant.power_oscillation",
                         .stage = Stage::kIllumination,
                         .summary = "power P (1 + a exp(-t/1000 s) cos(2 pi t/period)): "
                                    "temperature control that rings",
                         .reference = "ISO 11554:2017 (stability of laser power)",
                         .parameters = {{"oscillation_relative", 0, -0.9, 0.9, 0.1},
                                        {"period_s", 500, 10, 1e5, 500}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.power_w *= 1 + p[0] * std::exp(-frame.timestamp_s / 1000) *
                                   std::cos(2 * pi * frame.timestamp_s / p[1]);
  }
};

class BeamSideLobes final : public DescribedEffect {
 public:
  BeamSideLobes()
      : DescribedEffect({.id = "variant.beam_side_lobes",
                         .stage = Stage::kIllumination,
                         .summary = "two weaker lines of share g/2 each, some w on both sides",
                         .reference = "Siegman, Lasers (1986), chapter 18 (clipped beams)",
                         .parameters = {{"lobe_relative", 0, 0, 1, 0.05},
                                        {"lobe_offset_radii", 2.5, 1, 20, 2}}}) {}
  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double offset = p[1] * BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                          std::cos(frame.plate.incidence_angle_rad);
    scene.laser_irradiance_w_m2 = [=, g = p[0], before = std::move(scene.laser_irradiance_w_m2)](
                                      double x_m, double s_m) {
      return (before(x_m, s_m) +
              0.5 * g * (before(x_m, s_m - offset) + before(x_m, s_m + offset))) /
             (1 + g);
    };
  }
};

class BeamPedestal final : public DescribedEffect {
 public:
  BeamPedestal()
      : DescribedEffect({.id = "variant.beam_pedestal",
                         .stage = Stage::kIllumination,
                         .summary =
                             "share g of the power in a wider Gaussian: spontaneous emission "
                             "beside the mode",
                         .reference = "ISO 11146-1:2021 (beams that are no Gaussians)",
                         .parameters = {{"pedestal_fraction", 0, 0, 0.9, 0.1},
                                        {"width_ratio", 3, 1.2, 20, 2}}}) {}
  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double centre = frame.plate.line_offset_m;
    scene.laser_irradiance_w_m2 = [=, g = p[0], ratio = p[1],
                                   before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                    double s_m) {
      return (1 - g) * before(x_m, s_m) + g / ratio * before(x_m, centre + (s_m - centre) / ratio);
    };
  }
};

class LineStep final : public DescribedEffect {
 public:
  LineStep()
      : DescribedEffect({.id = "variant.line_step",
                         .stage = Stage::kIllumination,
                         .summary = "irradiance 1 + a on one side of a place of the fan, 1 - a on "
                                    "the other (a chip of the Powell lens)",
                         .reference = "Powell, US patent 4826299 (1989)",
                         .parameters = {{"step_relative", 0, -0.9, 0.9, 0.05},
                                        {"step_angle_deg", 0.5, -20, 20, 2}}}) {}
  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double place = frame.plate.laser_distance_m * std::tan(p[1] * pi / 180);
    const double width = 2e-3 * frame.plate.laser_distance_m;  // the lens blurs the edge
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [=, a = p[0], before = std::move(scene.laser_irradiance_w_m2)](
                                      double x_m, double s_m) {
      return (1 + a * std::tanh((x_m - place) / width)) * before(x_m, s_m);
    };
  }
};

class FadingAmbientLight final : public DescribedEffect {
 public:
  FadingAmbientLight()
      : DescribedEffect({.id = "variant.fading_ambient_light",
                         .stage = Stage::kIllumination,
                         .summary = "other light on the plate that fades as exp(-t/tau): dusk",
                         .reference = "thesis eq. 4.11 (aperture integration)",
                         .parameters = {{"ambient_radiance_w_m2_sr", 0, 0, 100, 0.1},
                                        {"fading_time_s", 500, 1, 1e5, 500}}}) {}
  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double radiance = p[0] * std::exp(-frame.timestamp_s / p[1]);
    scene.ambient_radiance_w_m2_sr = [=, before = std::move(scene.ambient_radiance_w_m2_sr)](
                                         double x_m, double s_m) {
      return (before ? before(x_m, s_m) : 0.0) + radiance;
    };
  }
};

// --- surface ------------------------------------------------------------------------------------

class GaussianScattering final : public DescribedEffect {
 public:
  GaussianScattering()
      : DescribedEffect({.id = "variant.gaussian_scattering",
                         .stage = Stage::kSurface,
                         .summary = "part f of the light leaves the plate spread over a Gaussian, "
                                    "not an exponential",
                         .reference = "Jensen et al., SIGGRAPH 2001",
                         .parameters = {{"scattered_fraction", 0, 0, 1, 0.2},
                                        {"spread_m", 8e-4, 1e-4, 1e-2, 5e-4}}}) {}
  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    // Two Gaussians folded are one: the line's own profile, wider.
    const double centre = frame.plate.line_offset_m;
    const double sigma = 0.5 * BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                         std::cos(frame.plate.incidence_angle_rad);
    const double ratio = std::hypot(sigma, p[1]) / sigma;
    scene.laser_irradiance_w_m2 = [=, f = p[0], before = std::move(scene.laser_irradiance_w_m2)](
                                      double x_m, double s_m) {
      return (1 - f) * before(x_m, s_m) + f / ratio * before(x_m, centre + (s_m - centre) / ratio);
    };
  }
};

// --- optics -------------------------------------------------------------------------------------

class RingHalo final : public DescribedEffect {
 public:
  RingHalo()
      : DescribedEffect({.id = "variant.ring_halo",
                         .stage = Stage::kOptics,
                         .summary = "part g of the light in a ring of a radius r0, a quarter of it "
                                    "wide",
                         .reference = "ISO 9358:1994 (veiling glare of image-forming systems)",
                         .parameters = {{"glare_fraction", 0, 0, 0.9, 0.05},
                                        {"ring_radius_m", 2e-4, 5e-6, 5e-3, 2e-4}}}) {}
  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;
    optics.transfer.push_back([g = p[0], radius = p[1]](double qx, double qy) {
      const double x = 2 * pi * radius * std::hypot(qx, qy);
      const double blur = x / 8;
      const double ring = blur > 8 ? 0 : std::cyl_bessel_j(0.0, x) * std::exp(-0.5 * blur * blur);
      return std::complex<double>(1 - g + g * ring);
    });
  }
};

class PowerLawHalo final : public DescribedEffect {
 public:
  PowerLawHalo()
      : DescribedEffect({.id = "variant.power_law_halo",
                         .stage = Stage::kOptics,
                         .summary = "part g of the light in a halo a/(2 pi (r^2 + a^2)^1.5): "
                                    "scattering by polished surfaces falls with a power",
                         .reference = "Harvey, Proc. SPIE 145 (1978) 155",
                         .parameters = {{"glare_fraction", 0, 0, 0.9, 0.05},
                                        {"halo_radius_m", 4e-5, 1e-6, 5e-3, 5e-5}}}) {}
  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;
    optics.transfer.push_back([g = p[0], a = p[1]](double qx, double qy) {
      return std::complex<double>(1 - g + g * std::exp(-2 * pi * a * std::hypot(qx, qy)));
    });
  }
};

class ApertureScale final : public DescribedEffect {
 public:
  ApertureScale()
      : DescribedEffect({.id = "variant.aperture_scale",
                         .stage = Stage::kOptics,
                         .summary = "f-number 5.6 (N/5.6)^(1 + p): the ring's scale is stretched",
                         .reference = "ISO 517:2008 (apertures of photographic lenses)",
                         .parameters = {{"scale_exponent", 0, -0.5, 0.5, 0.1}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.lens.f_number *= std::pow(frame.lens.f_number / 5.6, p[0]);
  }
};

class DefocusSpeckleLoss final : public DescribedEffect {
 public:
  DefocusSpeckleLoss()
      : DescribedEffect({.id = "variant.defocus_speckle_loss",
                         .stage = Stage::kOptics,
                         .summary =
                             "patterns multiply with the circle of confusion: 1 + c d/100 um "
                             "of them",
                         .reference = "Goodman, Speckle Phenomena in Optics, 2nd ed., section 5.3",
                         .parameters = {{"patterns_per_100_um", 0, 0, 50, 0.5}}}) {}
  void OnSpeckle(SpeckleModel& speckle, const FrameSetup& frame, Parameters p) const override {
    const double b = frame.ImageDistance();
    const double focused = 1 / (1 / frame.lens.focal_length_m - 1 / frame.plate.camera_distance_m);
    const double confusion_m = frame.PupilDiameter() * std::abs(1 - b / focused);
    const double modes = std::min(64.0, 1 + p[0] * confusion_m / 100e-6);
    speckle.pattern_weights = SplitPatterns(speckle.pattern_weights, EqualModes(modes));
  }
};

// --- sensor -------------------------------------------------------------------------------------

class PowerLawResponse final : public DescribedEffect {
 public:
  PowerLawResponse()
      : DescribedEffect({.id = "variant.power_law_response",
                         .stage = Stage::kSensor,
                         .summary = "charge e reads as e_r ((1 + e/e_r)^(1-p) - 1)/(1-p), e_r a "
                                    "twentieth of full scale",
                         .reference = "EMVA 1288 R4.0 Linear, linearity error LE",
                         .parameters = {{"compression", 0, 0, 0.9, 0.05}}}) {}
  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double reference = 0.05 * FullScaleElectrons(frame);
    const double power = 1 - p[0];
    for (double& e : electrons.values) {
      if (e > 0) e = reference * (std::pow(1 + e / reference, power) - 1) / power;
    }
  }
};

class KneeResponse final : public DescribedEffect {
 public:
  KneeResponse()
      : DescribedEffect({.id = "variant.knee_response",
                         .stage = Stage::kSensor,
                         .summary = "slope falls by a share above a part of full scale",
                         .reference = "EMVA 1288 R4.0 Linear, linearity error LE",
                         .parameters = {{"slope_loss", 0, 0, 0.95, 0.2},
                                        {"knee_relative", 0.5, 0.05, 0.95, 0.2}}}) {}
  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    const double knee = p[1] * FullScaleElectrons(frame);
    for (double& e : electrons.values) e -= p[0] * std::max(0.0, e - knee);
  }
};

class ChargeTrap final : public DescribedEffect {
 public:
  ChargeTrap()
      : DescribedEffect({.id = "variant.charge_trap",
                         .stage = Stage::kSensor,
                         .summary = "the first electrons are lost to traps: e - q (1 - exp(-e/q))",
                         .reference = "Janesick, Scientific Charge-Coupled Devices (2001), "
                                      "chapter 5 (traps)",
                         .parameters = {{"trapped_electrons", 0, 0, 1e5, 20}}}) {}
  void OnMeanElectrons(Image<double>& electrons, const Image<double>* /*previous*/,
                       const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;
    for (double& e : electrons.values) {
      if (e > 0) e -= p[0] * (1 - std::exp(-e / p[0]));
    }
  }
};

class QuadraticDarkSignal final : public DescribedEffect {
 public:
  QuadraticDarkSignal()
      : DescribedEffect({.id = "variant.quadratic_dark_signal",
                         .stage = Stage::kSensor,
                         .summary = "dark charge grows with the square of the exposure time "
                                    "(self-heating)",
                         .reference = "EMVA 1288 R4.0 Linear, section 3 (dark current)",
                         .parameters = {{"dark_electrons_per_s2", 0, 0, 1e6, 100}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_current_electrons_per_s += p[0] * frame.exposure_time_s;
  }
};

// --- time ---------------------------------------------------------------------------------------

class DarkWarmUp final : public DescribedEffect {
 public:
  DarkWarmUp()
      : DescribedEffect({.id = "variant.dark_warm_up",
                         .stage = Stage::kTime,
                         .summary = "mean dark signal mu_d + a (1 - exp(-t/tau)) instead of a line",
                         .reference = "EMVA 1288 R4.0 Linear, section 3.2",
                         .parameters = {{"dark_rise_electrons", 0, -1000, 1000, 5},
                                        {"warm_up_time_s", 200, 1, 1e5, 200}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_mean_electrons += p[0] * (1 - std::exp(-frame.timestamp_s / p[1]));
  }
};

class ExposureScale final : public DescribedEffect {
 public:
  ExposureScale()
      : DescribedEffect({.id = "variant.exposure_scale",
                         .stage = Stage::kTime,
                         .summary = "true exposure time 2 ms (t/2 ms)^(1 + p)",
                         .reference = "EMVA 1288 R4.0 Linear, section 2.1 (exposure time)",
                         .parameters = {{"exposure_exponent", 0, -0.5, 0.5, 0.02}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.exposure_time_s *= std::pow(frame.exposure_time_s / 2e-3, p[0]);
  }
};

template <typename Law>
const Effect* The() {
  static const Law law;
  return &law;
}

}  // namespace

std::span<const VariantLaw> VariantLaws() {
  static const std::vector<VariantLaw> laws = {
      {The<LinearDrift>(), {"whole_image"}, {"timestamp_s"}},
      {The<PowerStep>(), {"whole_image"}, {"timestamp_s"}},
      {The<PowerOscillation>(), {"whole_image"}, {"timestamp_s"}},
      {The<BeamSideLobes>(), {"line_flanks"}, {"laser_distance_m"}},
      {The<BeamPedestal>(), {"line_flanks"}, {"laser_distance_m"}},
      {The<LineStep>(), {"along_line"}, {"column", "field_position"}},
      {The<FadingAmbientLight>(),
       {"background", "whole_image"},
       {"exposure_time_s", "f_number", "timestamp_s"}},
      {The<GaussianScattering>(), {"line_flanks"}, {"camera_distance_m"}},
      {The<RingHalo>(), {"line_flanks", "background"}, {"signal_level"}},
      {The<PowerLawHalo>(), {"line_flanks", "background"}, {"signal_level"}},
      {The<ApertureScale>(), {"line_core", "speckle", "whole_image"}, {"f_number"}},
      {The<DefocusSpeckleLoss>(), {"speckle"}, {"camera_distance_m", "focus_distance_m"}},
      {The<PowerLawResponse>(), {"line_core"}, {"signal_level", "exposure_time_s"}},
      {The<KneeResponse>(), {"line_core"}, {"signal_level", "exposure_time_s"}},
      {The<ChargeTrap>(), {"line_flanks"}, {"signal_level", "exposure_time_s"}},
      {The<QuadraticDarkSignal>(),
       {"dark_frames", "background", "whole_image"},
       {"exposure_time_s"}},
      {The<DarkWarmUp>(), {"dark_frames", "background"}, {"timestamp_s"}},
      {The<ExposureScale>(), {"line_core", "whole_image"}, {"exposure_time_s"}},
  };
  return laws;
}

}  // namespace sightline::bench
