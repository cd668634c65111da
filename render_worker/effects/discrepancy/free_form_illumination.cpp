// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms of the illumination: profile, course along the line and over time of the
// laser, other light, coherence.
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/physics/constants.h"
#include "render_worker/effects/discrepancy/free_form_effect.h"
#include "render_worker/effects/illumination/ambient_radiance.h"

namespace sightline {
namespace {

constexpr double kLaserDistance_m = 0.4;  // distance functions are 1 here

// Hermite polynomials of a normal distribution.
double Hermite3(double t) { return t * (t * t - 3); }
double Hermite4(double t) { return t * t * (t * t - 6) + 3; }

class BeamTerm final : public FreeFormEffect {
 public:
  BeamTerm()
      : FreeFormEffect(
            "point_spread",
            {.id = "unknown.beam",
             .stage = Stage::kIllumination,
             .summary = "profile across the line: width, its growth with distance, skew "
                        "and kurtosis, a part in a pedestal of three widths; same power",
             .reference = "Cramer, Mathematical Methods of Statistics (1946), 17.6 "
                          "(Gram-Charlier series)",
             .parameters = {Coefficient("width_relative", 0.5, 0.05),
                            Coefficient("width_relative_per_distance_relative", 1, 0.1),
                            Coefficient("skewness", 1, 0.1), Coefficient("excess_kurtosis", 2, 0.2),
                            Coefficient("pedestal_fraction", 0.5, 0.05)}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // scaling would round
    const double distance = frame.plate.laser_distance_m;
    const double factor =
        std::max(0.2, 1 + p[0] + p[1] * (distance - kLaserDistance_m) / kLaserDistance_m);
    const double sigma =
        0.5 * BeamRadius(frame.laser, distance) / std::cos(frame.plate.incidence_angle_rad);
    const double centre = frame.plate.line_offset_m;
    const std::array<double, 3> shape = {p[2], p[3], p[4]};
    scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                       double s_m) {
      const double off = (s_m - centre) / factor;
      const double core = before(x_m, centre + off) / factor;
      const double pedestal = before(x_m, centre + off / 3) / (3 * factor);
      const double series = Series(off / sigma, shape);
      return std::max(0.0, core * (series - shape[2]) + shape[2] * pedestal);
    };
  }

  Axes CurveAxes() const override {
    return {"place_over_nominal_sigma", "profile_over_nominal_maximum", EvenlySpaced(-6, 6, 49)};
  }
  // At the distance where the law of distance is 1.
  double CurveAt(double t, Parameters p) const override {
    const double factor = std::max(0.2, 1 + p[0]);
    const double off = t / factor;
    return (std::exp(-0.5 * off * off) * (Series(off, {p[2], p[3], p[4]}) - p[4]) +
            p[4] * std::exp(-off * off / 18) / 3) /
           factor;
  }

 private:
  // A polynomial must not make light of the tails' last remains.
  static double Series(double t, const std::array<double, 3>& shape) {
    t = std::clamp(t, -4.0, 4.0);
    return 1 + shape[0] / 6 * Hermite3(t) + shape[1] / 24 * Hermite4(t);
  }
};

// Light beside the beam whose width grows with the beam's, unlike light that spreads on the plate:
// side lobes, spontaneous emission, stray light of the projector.
class BeamFootTerm final : public FreeFormEffect {
 public:
  BeamFootTerm()
      : FreeFormEffect("point_spread",
                       {.id = "unknown.beam_foot",
                        .stage = Stage::kIllumination,
                        .summary = "parts of the power in profiles of 2, 4 and 8 times the width",
                        .reference = "ISO 11146-1:2021 (beams that are no Gaussians)",
                        .parameters = {Coefficient("fraction_at_2_widths", 0.9, 0.05),
                                       Coefficient("fraction_at_4_widths", 0.9, 0.02),
                                       Coefficient("fraction_at_8_widths", 0.9, 0.02)}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // scaling would round
    const double centre = frame.plate.line_offset_m;
    scene.laser_irradiance_w_m2 = [=, c = std::array<double, 3>{p[0], p[1], p[2]},
                                   before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                    double s_m) {
      double sum = (1 - c[0] - c[1] - c[2]) * before(x_m, s_m);
      for (size_t k = 0; k < kWidths.size(); ++k) {
        if (c[k] == 0) continue;
        sum += c[k] / kWidths[k] * before(x_m, centre + (s_m - centre) / kWidths[k]);
      }
      return std::max(0.0, sum);
    };
  }

  Axes CurveAxes() const override {
    return {"place_over_nominal_sigma", "foot_over_nominal_maximum", EvenlySpaced(-16, 16, 65)};
  }
  double CurveAt(double t, Parameters p) const override {
    double sum = 0;
    for (size_t k = 0; k < kWidths.size(); ++k) {
      sum += p[k] / kWidths[k] * std::exp(-0.5 * t * t / (kWidths[k] * kWidths[k]));
    }
    return sum;
  }

 private:
  static constexpr std::array<double, 3> kWidths = {2, 4, 8};
};

// Light that leaves the laser at an angle to the line's plane: second lines, lobes on both sides.
class BeamLobesTerm final : public FreeFormEffect {
 public:
  BeamLobesTerm()
      : FreeFormEffect("point_spread",
                       {.id = "unknown.beam_lobes",
                        .stage = Stage::kIllumination,
                        .summary = "parts of the power in lines an offset d d_l/0.4 m behind and "
                                   "before, of w times the width",
                        .reference = "Siegman, Lasers (1986), chapter 18 (clipped beams)",
                        .parameters = {Coefficient("fraction_behind", 0.5, 0.02),
                                       Coefficient("fraction_before", 0.5, 0.02),
                                       {"offset_m",
                                        1e-3,
                                        1e-4,
                                        2e-2,
                                        1e-3,
                                        {1.5e-4, 2.2e-4, 3.2e-4, 4.7e-4, 7e-4, 1.5e-3, 2.2e-3,
                                         3.2e-3, 4.7e-3, 7e-3}},
                                       {"width_ratio", 1, 0.5, 5, 0.3}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p.first(2))) return;
    const double centre = frame.plate.line_offset_m;
    const double offset = p[2] * frame.plate.laser_distance_m / kLaserDistance_m /
                          std::cos(frame.plate.incidence_angle_rad);
    scene.laser_irradiance_w_m2 = [=, behind = p[0], ahead = p[1], width = p[3],
                                   before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                    double s_m) {
      const auto lobe = [&](double at) {
        return before(x_m, centre + (s_m - centre - at) / width) / width;
      };
      return std::max(0.0, (1 - behind - ahead) * before(x_m, s_m) + behind * lobe(offset) +
                               ahead * lobe(-offset));
    };
  }
};

class AlongLineTerm final : public FreeFormEffect {
 public:
  AlongLineTerm()
      : FreeFormEffect(
            "multiplicative_light",
            {.id = "unknown.along_line",
             .stage = Stage::kIllumination,
             .summary = "irradiance along the line times 1 + Legendre polynomials of "
                        "X/(L/2), 0 in the middle; times a power of the laser distance",
             .reference = "thesis 5.3.1 (laser lines)",
             .parameters = {Coefficient("legendre_1", 1, 0.1), Coefficient("legendre_2", 1, 0.1),
                            Coefficient("legendre_3", 1, 0.1), Coefficient("legendre_4", 1, 0.1),
                            Coefficient("laser_distance_exponent", 2, 0.1)}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.power_w *= std::pow(frame.plate.laser_distance_m / kLaserDistance_m, p[4]);
  }
  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p.first(4))) return;  // the line stays constant along X
    const double half_length =
        frame.plate.laser_distance_m * std::tan(frame.laser.fan_angle_rad / 2);
    const std::array<double, 4> c = {p[0], p[1], p[2], p[3]};
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                       double s_m) {
      return std::max(0.0, Factor(x_m / half_length, c)) * before(x_m, s_m);
    };
  }

  Axes CurveAxes() const override {
    return {"place_over_half_length", "irradiance_factor", EvenlySpaced(-1, 1, 41)};
  }
  double CurveAt(double x, Parameters p) const override { return Factor(x, p.first(4)); }

 private:
  static double Factor(double x, std::span<const double> c) {
    const double x2 = x * x;
    return 1 + x * (c[0] + c[2] * 0.5 * (5 * x2 - 3)) +
           x2 * (c[1] * 1.5 + c[3] * 0.125 * (35 * x2 - 30));
  }
};

// Interference, dust and facets of the line lens modulate the line along its fan, finer than the
// polynomials of unknown.along_line.
class FineAlongLineTerm final : public FreeFormEffect {
 public:
  FineAlongLineTerm()
      : FreeFormEffect(
            "multiplicative_light",
            {.id = "unknown.fine_along_line",
             .stage = Stage::kIllumination,
             .summary = "irradiance along the line of length L times 1 + sum over k from 2 to 7 of "
                        "a_k cos(2 pi k X/L) + b_k sin(2 pi k X/L), X 0 in the middle",
             .reference = "thesis 5.3.1 (laser lines)",
             .parameters = Harmonics(kFirstHarmonic, kFirstHarmonic + 5, 0.02)}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // the line stays constant along X
    const double length =
        2 * frame.plate.laser_distance_m * std::tan(frame.laser.fan_angle_rad / 2);
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [length, c = std::vector<double>(p.begin(), p.end()),
                                   before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                    double s_m) {
      return std::max(0.0, 1 + FourierSeries(x_m / length, kFirstHarmonic, c)) * before(x_m, s_m);
    };
  }

  Axes CurveAxes() const override {
    return {"place_over_length", "irradiance_factor", EvenlySpaced(-0.5, 0.5, 97)};
  }
  double CurveAt(double x, Parameters p) const override {
    return 1 + FourierSeries(x, kFirstHarmonic, p);
  }

 private:
  static constexpr int kFirstHarmonic = 2;
};

class PowerCourseTerm final : public FreeFormEffect {
 public:
  PowerCourseTerm()
      : FreeFormEffect("time_course",
                       {.id = "unknown.power_course",
                        .stage = Stage::kIllumination,
                        .summary = "power piecewise linear in the time since switching on",
                        .reference = "ISO 11554:2017 (stability of laser power over time)",
                        .parameters = {Coefficient("power_relative_at_30_s", 0.9, 0.05),
                                       Coefficient("power_relative_at_180_s", 0.9, 0.05),
                                       Coefficient("power_relative_at_500_s", 0.9, 0.05),
                                       Coefficient("power_relative_at_1000_s", 0.9, 0.05),
                                       Coefficient("power_relative_at_1800_s", 0.9, 0.05)}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.power_w *= CurveAt(frame.timestamp_s, p);
  }

  Axes CurveAxes() const override {
    return {"timestamp_s", "power_factor", EvenlySpaced(0, 2000, 81)};
  }
  double CurveAt(double timestamp_s, Parameters p) const override {
    static constexpr std::array<double, 5> kKnots_s = {30, 180, 500, 1000, 1800};
    return std::max(0.0, 1 + LinearThroughKnots(kKnots_s, p, timestamp_s));
  }
};

// Arbitrary variation of the power, determined by the light of each recording: white noise without
// correlation between recordings, otherwise a course in time. It is random per recording
// (scatter_law), so it changes no expectation.
class PowerScatterTerm final : public FreeFormEffect {
 public:
  PowerScatterTerm()
      : FreeFormEffect("noise", {.id = "unknown.power_scatter",
                                 .stage = Stage::kIllumination,
                                 .kind = EffectKind::kRandomPerRecording,
                                 .random_law = RandomLaw::kCorrelatedPower,
                                 .summary = "power of recordings scatters normally by s, with "
                                            "correlation exp(-|time apart| / t)",
                                 .reference = "Uhlenbeck and Ornstein, Phys. Rev. 36 (1930) 823; "
                                              "Rasmussen and Williams, Gaussian Processes for "
                                              "Machine Learning, 4.2.1",
                                 .parameters = {{"power_scatter_relative", 0, 0, 0.5, 0.03},
                                                {"correlation_time_s", 100, 0.1, 1e5, 900}}}) {}
};

// Linear throughout: radiance below 0 takes light away, as far as there is any.
class OtherLightTerm final : public FreeFormEffect {
 public:
  OtherLightTerm()
      : FreeFormEffect(
            "additive_light",
            {.id = "unknown.other_light",
             .stage = Stage::kIllumination,
             .summary = "radiance of the plate besides the laser's: constant, growing with time, "
                        "with gradients from centre to edge of the sensor; more on green and blue",
             .reference = "radiance invariance and aperture integration: thesis eq. 4.11",
             .parameters = {Coefficient("radiance_w_m2_sr", 100, 0.1, kRadianceDecades),
                            Coefficient("radiance_per_time_w_m2_sr_s", 0.1, 1e-4, kRadianceDecades),
                            Coefficient("gradient_u_w_m2_sr", 100, 0.03, kRadianceDecades),
                            Coefficient("gradient_v_w_m2_sr", 100, 0.03, kRadianceDecades),
                            Coefficient("extra_green_w_m2_sr", 100, 0.1, kRadianceDecades),
                            Coefficient("extra_blue_w_m2_sr", 100, 0.1, kRadianceDecades)}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    const double radiance = p[0] + p[1] * frame.timestamp_s;
    if (radiance == 0 && p[2] == 0 && p[3] == 0) return;  // an empty function stays empty
    const double pitch = frame.sensor.pixel_pitch_m;
    const double magnification = frame.ImageDistance() / frame.plate.camera_distance_m;
    const double slope_u = p[2] * magnification / (0.5 * frame.sensor.columns_px * pitch);
    const double slope_v = p[3] * magnification / (0.5 * frame.sensor.rows_px * pitch);
    scene.ambient_radiance_w_m2_sr = [=, before = std::move(scene.ambient_radiance_w_m2_sr)](
                                         double x_m, double s_m) {
      return (before ? before(x_m, s_m) : 0) + radiance + slope_u * x_m + slope_v * s_m;
    };
  }
  // Electrons as if of the laser's wavelength on red pixels.
  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup& frame,
                         Parameters p) const override {
    if (frame.sensor.channels() < 3 || !frame.shutter_open) return;
    const double ratio = frame.PupilDiameter() / frame.ImageDistance();
    const double per_radiance = std::numbers::pi / 4 * frame.lens.transmission * ratio * ratio *
                                frame.sensor.quantum_efficiency[kRed].At(frame.laser.wavelength_m) *
                                frame.laser.wavelength_m / (kPlanck_j_s * kSpeedOfLight_m_per_s);
    for (const int channel : {kGreen, kBlue}) {
      const double radiance = p[channel == kGreen ? 4 : 5];
      if (radiance == 0) continue;
      Image<float>& flux = light.incoherent_electron_flux_m2_s[channel];
      if (flux.empty()) flux = Image<float>(light.roi.columns_px, light.roi.rows_px, 0.0F);
      for (float& value : flux.values) value += static_cast<float>(per_radiance * radiance);
    }
  }
};

// Speckle of one polarised mode has the largest contrast there is, so the number of modes only
// grows. What grows with defocus is of the lens (`unknown.speckle_averaging`).
class CoherenceTerm final : public FreeFormEffect {
 public:
  CoherenceTerm()
      : FreeFormEffect("noise",
                       {.id = "unknown.coherence",
                        .stage = Stage::kIllumination,
                        .summary = "number of independent speckle patterns 1 + a + b (4/N)^2 + "
                                   "c (N/4)^2, contrast 1/sqrt(M)",
                        .reference = "Goodman, Speckle Phenomena in Optics, 2nd ed., sections 3.3 "
                                     "and 6.3",
                        .parameters = {{"more_modes", 0, 0, 20, 0.2},
                                       {"more_modes_with_aperture", 0, 0, 20, 0.1},
                                       {"more_modes_with_f_number", 0, 0, 20, 0.1}}}) {}

  void OnSpeckle(SpeckleModel& speckle, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // the patterns stay as they are
    SplitIntoModes(speckle, 1 + CurveAt(frame.lens.f_number, p));
  }

  Axes CurveAxes() const override {
    return {"f_number", "more_speckle_patterns", {1.4, 2, 2.8, 4, 5.6, 8, 11, 16, 22}};
  }
  double CurveAt(double f_number, Parameters p) const override {
    const double aperture2 = 16 / (f_number * f_number);
    return p[0] + p[1] * aperture2 + p[2] / aperture2;
  }
};

}  // namespace

std::vector<const FreeFormEffect*> IlluminationTerms() {
  static const BeamTerm beam;
  static const BeamFootTerm beam_foot;
  static const BeamLobesTerm beam_lobes;
  static const AlongLineTerm along_line;
  static const FineAlongLineTerm fine_along_line;
  static const PowerCourseTerm power_course;
  static const PowerScatterTerm power_scatter;
  static const OtherLightTerm other_light;
  static const CoherenceTerm coherence;
  return {&beam,         &beam_foot,     &beam_lobes,  &along_line, &fine_along_line,
          &power_course, &power_scatter, &other_light, &coherence};
}

}  // namespace sightline
