// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms of the lens: halos, wavefront, amount of light against aperture and
// field, distortion.
#include <array>
#include <cmath>
#include <numbers>

#include "render_worker/effects/discrepancy/free_form_effect.h"

namespace sightline {
namespace {

constexpr double kFullAperture = 1.4;

// Halos are sums of Gaussians. The transfer function is 1 at 0, so light is conserved for any
// signs.
class HaloTerm final : public FreeFormEffect {
 public:
  HaloTerm()
      : FreeFormEffect("point_spread",
                       {.id = "unknown.halo",
                        .stage = Stage::kOptics,
                        .summary = "parts of the light in Gaussian halos of sigma 1.5, 5, 15, 50 "
                                   "and 150 px on the sensor",
                        .reference = "ISO 9358:1994 (veiling glare of image-forming systems)",
                        .parameters = {Coefficient("fraction_at_1.5_px", 0.9, 0.05),
                                       Coefficient("fraction_at_5_px", 0.9, 0.05),
                                       Coefficient("fraction_at_15_px", 0.9, 0.05),
                                       Coefficient("fraction_at_50_px", 0.9, 0.05),
                                       Coefficient("fraction_at_150_px", 0.9, 0.05)}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // the list of transfer functions stays as it is
    std::array<double, 5> part, exponent;
    for (size_t k = 0; k < part.size(); ++k) {
      part[k] = p[k];
      const double x = std::numbers::pi * kSigmas_px[k] * frame.sensor.pixel_pitch_m;
      exponent[k] = -2 * x * x;
    }
    optics.transfer.push_back([part, exponent](double qx, double qy) {
      double sum = 1;
      for (size_t k = 0; k < part.size(); ++k) {
        sum += part[k] * std::expm1(exponent[k] * (qx * qx + qy * qy));
      }
      return std::complex<double>(sum);
    });
  }

  Axes CurveAxes() const override {
    return {"distance_px", "halo_line_spread_per_px", EvenlySpaced(0, 200, 101)};
  }
  double CurveAt(double distance_px, Parameters p) const override {
    double sum = 0;
    for (size_t k = 0; k < kSigmas_px.size(); ++k) {
      const double t = distance_px / kSigmas_px[k];
      sum += p[k] * std::exp(-0.5 * t * t) / (std::sqrt(2 * std::numbers::pi) * kSigmas_px[k]);
    }
    return sum;
  }

 private:
  static constexpr std::array<double, 5> kSigmas_px = {1.5, 5, 15, 50, 150};
};

// Derivatives of Gaussians across the line: transfer 2 pi i q sigma exp(-2 (pi q sigma)^2), 0 at 0,
// so light is conserved.
class OneSidedHaloTerm final : public FreeFormEffect {
 public:
  OneSidedHaloTerm()
      : FreeFormEffect("point_spread",
                       {.id = "unknown.one_sided_halo",
                        .stage = Stage::kOptics,
                        .summary = "odd part of the line spread: more light below the line, less "
                                   "above, on the scales 2, 8 and 30 px",
                        .reference = "Welford, Aberrations of Optical Systems (1986), chapter 8",
                        .parameters = {Coefficient("odd_part_at_2_px", 0.5, 0.05),
                                       Coefficient("odd_part_at_8_px", 0.5, 0.03),
                                       Coefficient("odd_part_at_30_px", 0.5, 0.02)}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // the list of transfer functions stays as it is
    std::array<double, 3> part, angle;
    for (size_t k = 0; k < part.size(); ++k) {
      part[k] = p[k];
      angle[k] = 2 * std::numbers::pi * kSigmas_px[k] * frame.sensor.pixel_pitch_m;
    }
    optics.transfer.push_back([part, angle](double, double qy) {
      double odd = 0;
      for (size_t k = 0; k < part.size(); ++k) {
        const double x = angle[k] * qy;
        odd -= part[k] * x * std::exp(-0.5 * x * x);
      }
      return std::complex<double>(1, odd);
    });
  }

  Axes CurveAxes() const override {
    return {"distance_below_px", "odd_line_spread_per_px", EvenlySpaced(-100, 100, 101)};
  }
  double CurveAt(double distance_px, Parameters p) const override {
    double sum = 0;
    for (size_t k = 0; k < kSigmas_px.size(); ++k) {
      const double t = distance_px / kSigmas_px[k];
      sum += p[k] * t * std::exp(-0.5 * t * t) / (std::sqrt(2 * std::numbers::pi) * kSigmas_px[k]);
    }
    return sum;
  }

 private:
  static constexpr std::array<double, 3> kSigmas_px = {2, 8, 30};
};

// Copies displaced across the line and around, blurred in proportion to how far away they are:
// reflections and rings.
class DisplacedImagesTerm final : public FreeFormEffect {
 public:
  DisplacedImagesTerm()
      : FreeFormEffect(
            "point_spread",
            {.id = "unknown.displaced_images",
             .stage = Stage::kOptics,
             .summary = "parts of the light in images displaced by d below, above and in a ring "
                        "all around, blurred by sigma = b d",
             .reference = "ISO 9358:1994 (veiling glare of image-forming systems)",
             .parameters = {Coefficient("fraction_below", 0.5, 0.02),
                            Coefficient("fraction_above", 0.5, 0.02),
                            Coefficient("fraction_around", 0.5, 0.02),
                            {"displacement_m",
                             1e-4,
                             1e-5,
                             2e-3,
                             1e-4,
                             {2e-5, 3e-5, 4.5e-5, 6.5e-5, 1.4e-4, 2e-4, 3e-4, 4.5e-4, 6.5e-4}},
                            {"blur_over_displacement", 0.1, 0.01, 0.6, 0.1}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (IsNull(p.first(3))) return;  // the list of transfer functions stays as it is
    const double turn = 2 * std::numbers::pi * p[3], spread = turn * p[4];
    optics.transfer.push_back([=, below = p[0], above = p[1], ring = p[2]](double qx, double qy) {
      const double square = qx * qx + qy * qy;
      const double kept = std::exp(-0.5 * spread * spread * square);
      const std::complex<double> copy = std::polar(kept, -turn * qy);
      std::complex<double> sum = 1.0 + below * (copy - 1.0) + above * (std::conj(copy) - 1.0);
      if (ring != 0) sum += ring * (kept * std::cyl_bessel_j(0.0, turn * std::sqrt(square)) - 1);
      return sum;
    });
  }
};

class WavefrontTerm final : public FreeFormEffect {
 public:
  WavefrontTerm()
      : FreeFormEffect(
            "point_spread",
            {.id = "unknown.wavefront",
             .stage = Stage::kOptics,
             .summary = "focused on another distance; wavefront: defocus times (4/N)^2, (r/R)^4, "
                        "(r/R)^6",
             .reference = "Welford, Aberrations of Optical Systems (1986), chapter 8; thesis eq. "
                          "4.25",
             .parameters = {Coefficient("focus_distance_relative", 0.5, 0.03),
                            Coefficient("defocus_with_aperture_per_m", 5, 0.05),
                            Coefficient("fourth_order_waves", 50, 2),
                            Coefficient("sixth_order_waves", 50, 2)}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.lens.focus_distance_m = frame.lens.focus_distance_m.value() * (1 + p[0]);
  }
  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    const double aperture = 4 / frame.lens.f_number;
    const double more = p[1] * aperture * aperture;
    if (more != 0) {
      optics.curvature = [more, before = std::move(optics.curvature)](double depth_m, double u_m,
                                                                      double v_m) {
        return before(depth_m, u_m, v_m) + more;
      };
    }
    if (p[2] == 0 && p[3] == 0) return;  // the list of terms stays as it is
    const double radius = 0.5 * frame.lens.focal_length_m / kFullAperture;
    const SeidelTerm fourth{p[2] * optics.wavelength_m, radius, 4, 0, 0};
    const SeidelTerm sixth{p[3] * optics.wavelength_m, radius, 6, 0, 0};
    optics.pupil = [fourth, sixth, before = std::move(optics.pupil)](double u_m, double v_m) {
      Pupil pupil = before(u_m, v_m);
      pupil.seidel.push_back(fourth);
      pupil.seidel.push_back(sixth);
      return pupil;
    };
  }

  Axes CurveAxes() const override {
    return {"radius_over_radius_at_f_1.4", "wavefront_waves_without_defocus",
            EvenlySpaced(0, 1, 21)};
  }
  double CurveAt(double r, Parameters p) const override {
    return std::pow(r, 4) * (p[2] + p[3] * r * r);
  }
};

// Lens and mount warm up, and the focus creeps.
class FocusCourseTerm final : public FreeFormEffect {
 public:
  FocusCourseTerm()
      : FreeFormEffect(
            "time_course",
            {.id = "unknown.focus_course",
             .stage = Stage::kOptics,
             .summary = "focus distance times 1 + c, c piecewise linear in the time since "
                        "switching on",
             .reference = "Yoder, Mounting Optics in Optical Instruments, 2nd ed. "
                          "(2008), chapter 14 (temperature)",
             .parameters = {Coefficient("focus_relative_at_30_s", 0.5, 0.03),
                            Coefficient("focus_relative_at_300_s", 0.5, 0.03),
                            Coefficient("focus_relative_at_900_s", 0.5, 0.03),
                            Coefficient("focus_relative_at_1800_s", 0.5, 0.03)}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.lens.focus_distance_m =
        frame.lens.focus_distance_m.value() * CurveAt(frame.timestamp_s, p);
  }

  Axes CurveAxes() const override {
    return {"timestamp_s", "focus_distance_factor", EvenlySpaced(0, 2000, 81)};
  }
  double CurveAt(double timestamp_s, Parameters p) const override {
    static constexpr std::array<double, 4> kKnots_s = {30, 300, 900, 1800};
    return std::max(0.1, 1 + LinearThroughKnots(kKnots_s, p, timestamp_s));
  }
};

class FocusCurvatureTerm final : public FreeFormEffect {
 public:
  FocusCurvatureTerm()
      : FreeFormEffect("point_spread",
                       {.id = "unknown.focus_curvature",
                        .stage = Stage::kOptics,
                        .summary = "defocus changed by a r^2 + b r^4, r the image height in 5 mm",
                        .reference = "Welford, Aberrations of Optical Systems (1986), chapter 8",
                        .parameters = {Coefficient("square_per_m", 10, 0.2),
                                       Coefficient("fourth_per_m", 10, 0.2)}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (IsNull(p)) return;  // the field stays the same everywhere
    const std::array<double, 2> c = {p[0], p[1]};
    optics.field_dependent = true;
    optics.curvature = [c, before = std::move(optics.curvature)](double depth_m, double u_m,
                                                                 double v_m) {
      return before(depth_m, u_m, v_m) + ChangeAt(std::hypot(u_m, v_m), c);
    };
  }

  Axes CurveAxes() const override {
    return {"image_height_m", "change_of_wavefront_curvature_per_m", EvenlySpaced(0, 6e-3, 25)};
  }
  double CurveAt(double height_m, Parameters p) const override { return ChangeAt(height_m, p); }

 private:
  static double ChangeAt(double height_m, std::span<const double> c) {
    const double r2 = std::pow(height_m / kImageHeight_m, 2);
    return r2 * (c[0] + c[1] * r2);
  }
};

class ApertureTerm final : public FreeFormEffect {
 public:
  ApertureTerm()
      : FreeFormEffect("multiplicative_light",
                       {.id = "unknown.aperture",
                        .stage = Stage::kOptics,
                        .summary = "transmission times (N/4)^a (d_c/0.35 m)^b (d_foc/0.35 m)^c; "
                                   "diameter of the stop off by the same at every f-number, and by "
                                   "the same part",
                        .reference = "thesis eq. 4.11 (aperture integration)",
                        .parameters = {Coefficient("f_number_exponent", 2, 0.03),
                                       Coefficient("camera_distance_exponent", 4, 0.1),
                                       Coefficient("focus_distance_exponent", 4, 0.1),
                                       Coefficient("diameter_offset_m", 3e-4, 1e-5),
                                       Coefficient("diameter_relative", 0.8, 0.05)}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    constexpr double kDistance_m = 0.35;
    if (IsNull(p)) return;  // dividing would round
    frame.lens.transmission *= std::pow(frame.lens.f_number / 4, p[0]) *
                               std::pow(frame.plate.camera_distance_m / kDistance_m, p[1]) *
                               std::pow(frame.lens.focus_distance_m.value() / kDistance_m, p[2]);
    if (p[3] == 0 && p[4] == 0) return;
    const double diameter = frame.PupilDiameter();
    frame.lens.f_number =
        frame.lens.focal_length_m / std::max(0.2 * diameter, diameter * (1 + p[4]) + p[3]);
  }

  Axes CurveAxes() const override {
    return {"f_number", "transmission_factor", {1.4, 2, 2.8, 4, 5.6, 8, 11, 16, 22}};
  }
  double CurveAt(double f_number, Parameters p) const override {
    return std::pow(f_number / 4, p[0]);
  }
};

// `factor`: of the place on the sensor (u, v) in units of kImageHeight_m; negative light is none.
template <typename Factor>
void MultiplyOverField(PixelIrradiance& light, const FrameSetup& frame, const Factor& factor) {
  const double step = frame.sensor.pixel_pitch_m / kImageHeight_m;
  for (int i = 0; i < light.roi.rows_px; ++i) {
    const double v = step * (light.roi.row_px + i);
    for (int j = 0; j < light.roi.columns_px; ++j) {
      const double u = step * (light.roi.column_px + j);
      const auto times = static_cast<float>(std::max(0.0, factor(u, v)));
      if (!light.laser_irradiance_w_m2.empty()) light.laser_irradiance_w_m2.At(i, j) *= times;
      for (Image<float>& flux : light.incoherent_electron_flux_m2_s) {
        if (!flux.empty()) flux.At(i, j) *= times;
      }
    }
  }
}

class FieldTerm final : public FreeFormEffect {
 public:
  FieldTerm()
      : FreeFormEffect(
            "multiplicative_light",
            {.id = "unknown.field",
             .stage = Stage::kOptics,
             .summary = "light times a polynomial of the place on the sensor, in 5 mm: "
                        "r^2, r^4, r^2 times 4/N, u, v, r^8",
             .reference = "Ray, Applied Photographic Optics, 3rd ed., section 13.4 "
                          "(vignetting)",
             .parameters = {Coefficient("square", 5, 0.1), Coefficient("fourth", 5, 0.1),
                            Coefficient("square_with_aperture", 5, 0.05),
                            Coefficient("slope_u", 2, 0.03), Coefficient("slope_v", 2, 0.03),
                            Coefficient("eighth", 5, 0.1)}}) {}

  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup& frame,
                         Parameters p) const override {
    if (IsNull(p)) return;
    const double square = p[0] + p[2] * 4 / frame.lens.f_number;
    MultiplyOverField(light, frame, [&](double u, double v) {
      const double r2 = u * u + v * v;
      return 1 + r2 * (square + r2 * (p[1] + p[5] * r2 * r2)) + p[3] * u + p[4] * v;
    });
  }

  Axes CurveAxes() const override {
    return {"image_height_m", "light_factor_at_f_4_without_slopes", EvenlySpaced(0, 6e-3, 25)};
  }
  double CurveAt(double height_m, Parameters p) const override {
    const double r2 = std::pow(height_m / kImageHeight_m, 2);
    return 1 + r2 * (p[0] + p[2] + r2 * (p[1] + p[5] * r2 * r2));
  }
};

// A rim before or behind the stop cuts the pupil off the axis only where it is wide, by what no
// polynomial of low order in the aperture follows.
class PupilCutTerm final : public FreeFormEffect {
 public:
  PupilCutTerm()
      : FreeFormEffect(
            "multiplicative_light",
            {.id = "unknown.pupil_cut",
             .stage = Stage::kOptics,
             .summary = "light off the axis times 1 + (a r^2 + b r^4) (1.4/N)^2 + "
                        "(c r^2 + d r^4) (1.4/N)^6, r the image height in 5 mm",
             .reference = "Ray, Applied Photographic Optics, 3rd ed., section 13.4 (vignetting)",
             .parameters = {Coefficient("square_by_area", 5, 0.1),
                            Coefficient("fourth_by_area", 5, 0.1),
                            Coefficient("square_wide_open", 5, 0.1),
                            Coefficient("fourth_wide_open", 5, 0.1)}}) {}

  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup& frame,
                         Parameters p) const override {
    if (IsNull(p)) return;
    const double area = std::pow(1.4 / frame.lens.f_number, 2);
    const double wide_open = area * area * area;
    const double square = p[0] * area + p[2] * wide_open;
    const double fourth = p[1] * area + p[3] * wide_open;
    MultiplyOverField(light, frame, [=](double u, double v) {
      const double r2 = u * u + v * v;
      return 1 + r2 * (square + r2 * fourth);
    });
  }

  Axes CurveAxes() const override {
    return {"image_height_m", "light_factor_at_f_1.4", EvenlySpaced(0, 6e-3, 25)};
  }
  double CurveAt(double height_m, Parameters p) const override {
    const double r2 = std::pow(height_m / kImageHeight_m, 2);
    return 1 + r2 * (p[0] + p[2] + r2 * (p[1] + p[3]));
  }
};

class DistortionTerm final : public FreeFormEffect {
 public:
  DistortionTerm()
      : FreeFormEffect(
            "geometry",
            {.id = "unknown.distortion",
             .stage = Stage::kOptics,
             .summary = "place on the sensor times 1 + a + b r^2 + c r^4, in 5 mm",
             .reference = "Brown, Photogrammetric Engineering 37 (1971) 855",
             .parameters = {Coefficient("scale", 0.5, 0.02), Coefficient("square", 0.5, 0.01),
                            Coefficient("fourth", 0.5, 0.01)}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup&, Parameters p) const override {
    if (IsNull(p)) return;  // an empty mapping stays empty
    const std::array<double, 3> c = {p[0], p[1], p[2]};
    scene.image_mapping = [c, before = std::move(scene.image_mapping)](SensorPoint point) {
      if (before) point = before(point);
      const double r2 =
          (point.u_m * point.u_m + point.v_m * point.v_m) / (kImageHeight_m * kImageHeight_m);
      // The sensor point of a larger image looks nearer to the axis.
      const double factor = 1 / (1 + c[0] + r2 * (c[1] + r2 * c[2]));
      return SensorPoint{factor * point.u_m, factor * point.v_m};
    };
  }

  Axes CurveAxes() const override {
    return {"image_height_m", "scale_factor", EvenlySpaced(0, 6e-3, 25)};
  }
  double CurveAt(double height_m, Parameters p) const override {
    const double r2 = std::pow(height_m / kImageHeight_m, 2);
    return 1 + p[0] + r2 * (p[1] + p[2] * r2);
  }
};

// The lens causes changes with the circle of confusion. In focus nothing changes.
class SpeckleAveragingTerm final : public FreeFormEffect {
 public:
  SpeckleAveragingTerm()
      : FreeFormEffect("noise",
                       {.id = "unknown.speckle_averaging",
                        .stage = Stage::kOptics,
                        .summary = "number of independent speckle patterns 1 + a d + b d^2, d the "
                                   "circle of confusion in 10 px",
                        .reference = "Goodman, Speckle Phenomena in Optics, 2nd ed., section 5.3",
                        .parameters = {{"more_modes_with_defocus", 0, 0, 20, 0.1},
                                       {"more_modes_with_defocus_squared", 0, 0, 20, 0.1}}}) {}

  void OnSpeckle(SpeckleModel& speckle, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // the patterns stay as they are
    const double f = frame.lens.focal_length_m;
    const double image_of_plate_m = 1 / (1 / f - 1 / frame.plate.camera_distance_m);
    const double confusion_m =
        frame.PupilDiameter() * std::abs(frame.ImageDistance() / image_of_plate_m - 1);
    SplitIntoModes(speckle, 1 + CurveAt(confusion_m / frame.sensor.pixel_pitch_m, p));
  }

  Axes CurveAxes() const override {
    return {"circle_of_confusion_px", "more_speckle_patterns", EvenlySpaced(0, 50, 26)};
  }
  double CurveAt(double confusion_px, Parameters p) const override {
    const double d = 0.1 * confusion_px;
    return d * (p[0] + p[1] * d);
  }
};

}  // namespace

std::vector<const FreeFormEffect*> OpticsTerms() {
  static const HaloTerm halo;
  static const OneSidedHaloTerm one_sided_halo;
  static const DisplacedImagesTerm displaced_images;
  static const WavefrontTerm wavefront;
  static const FocusCourseTerm focus_course;
  static const FocusCurvatureTerm focus_curvature;
  static const ApertureTerm aperture;
  static const FieldTerm field;
  static const PupilCutTerm pupil_cut;
  static const DistortionTerm distortion;
  static const SpeckleAveragingTerm speckle_averaging;
  return {&halo,         &one_sided_halo,  &displaced_images, &wavefront,
          &focus_course, &focus_curvature, &aperture,         &field,
          &pupil_cut,    &distortion,      &speckle_averaging};
}

}  // namespace sightline
