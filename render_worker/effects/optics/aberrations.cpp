// SPDX-License-Identifier: Apache-2.0
// Seidel aberrations of the wavefront, in waves at the rim of the full pupil (R at f/1.4) and at
// the image height 5 mm. The axis of coma and astigmatism is the direction from the principal
// point.
#include <cmath>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr double kFullAperture = 1.4;
constexpr double kImageHeight_m = 5e-3;
// Coefficients are those of the rim at f/1.4 and 5 mm, where few lenses are used: at f/2.8 and 3 mm
// this much coma is 15 waves, and 6 of astigmatism, more than any lens that is sold has.
constexpr double kMost_waves = 200;
constexpr const char* kAberrationReference =
    "Welford, Aberrations of Optical Systems (1986), chapter 8; thesis eq. 4.25";

double FullPupilRadius(const FrameSetup& frame) {
  return 0.5 * frame.lens.focal_length_m / kFullAperture;
}

class SphericalAberrationEffect final : public DescribedEffect {
 public:
  SphericalAberrationEffect()
      : DescribedEffect(
            {.id = "optics.spherical_aberration",
             .stage = Stage::kOptics,
             .signature = {{"line_core", "line_flanks"}, {"f_number", "focus_distance_m"}},
             .summary = "W = w040 lambda (r/R)^4",
             .reference = kAberrationReference,
             .parameters = {{"w040_waves", 0, -kMost_waves, kMost_waves, 3}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // the list of terms stays as it is
    const SeidelTerm term{p[0] * optics.wavelength_m, FullPupilRadius(frame), 4, 0, 0};
    optics.pupil = [term, before = std::move(optics.pupil)](double u_m, double v_m) {
      Pupil pupil = before(u_m, v_m);
      pupil.seidel.push_back(term);
      return pupil;
    };
  }
};

// W = w lambda (h/5 mm)^h_power (r/R)^r_power cos^h_power.
void AddFieldTerm(OpticsModel& optics, const FrameSetup& frame, double waves, int radial_power,
                  int field_power) {
  if (waves == 0) return;  // the list of terms stays as it is
  const double coefficient = waves * optics.wavelength_m;
  const double radius = FullPupilRadius(frame);
  optics.field_dependent = true;
  optics.pupil = [=, before = std::move(optics.pupil)](double u_m, double v_m) {
    Pupil pupil = before(u_m, v_m);
    const double height = std::hypot(u_m, v_m) / kImageHeight_m;
    pupil.seidel.push_back({coefficient * std::pow(height, field_power), radius, radial_power,
                            field_power, std::atan2(v_m, u_m)});
    return pupil;
  };
}

class ComaEffect final : public DescribedEffect {
 public:
  ComaEffect()
      : DescribedEffect({.id = "optics.coma",
                         .stage = Stage::kOptics,
                         .signature = {{"line_flanks", "off_axis"}, {"f_number", "field_position"}},
                         .summary = "W = w131 lambda (h/5 mm) (r/R)^3 cos(phi)",
                         .reference = kAberrationReference,
                         .parameters = {{"w131_waves", 0, -kMost_waves, kMost_waves, 3}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    AddFieldTerm(optics, frame, p[0], 3, 1);
  }
};

class AstigmatismEffect final : public DescribedEffect {
 public:
  AstigmatismEffect()
      : DescribedEffect({.id = "optics.astigmatism",
                         .stage = Stage::kOptics,
                         .signature = {{"line_core", "off_axis"}, {"f_number", "field_position"}},
                         .summary = "W = w222 lambda (h/5 mm)^2 (r/R)^2 cos^2(phi)",
                         .reference = kAberrationReference,
                         .parameters = {{"w222_waves", 0, -kMost_waves, kMost_waves, 3}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    AddFieldTerm(optics, frame, p[0], 2, 2);
  }
};

class FieldCurvatureEffect final : public DescribedEffect {
 public:
  FieldCurvatureEffect()
      : DescribedEffect(
            {.id = "optics.field_curvature",
             .stage = Stage::kOptics,
             .signature = {{"line_core", "off_axis"}, {"f_number", "field_position"}},
             .summary = "W = w220 lambda (h/5 mm)^2 (r/R)^2: defocus that grows off axis",
             .reference = kAberrationReference,
             .parameters = {{"w220_waves", 0, -kMost_waves, kMost_waves, 3}}}) {}

  // W = -1/2 C r^2, so the term adds C = -2 w220 lambda (h/5 mm)^2/R^2 to the curvature.
  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // the field stays the same everywhere
    const double radius = FullPupilRadius(frame);
    const double per_square_height =
        -2 * p[0] * optics.wavelength_m / (radius * radius * kImageHeight_m * kImageHeight_m);
    optics.field_dependent = true;
    optics.curvature = [per_square_height, before = std::move(optics.curvature)](
                           double depth_m, double u_m, double v_m) {
      return before(depth_m, u_m, v_m) + per_square_height * (u_m * u_m + v_m * v_m);
    };
  }
};

}  // namespace

const Effect& SphericalAberration() {
  static const SphericalAberrationEffect effect;
  return effect;
}
const Effect& Coma() {
  static const ComaEffect effect;
  return effect;
}
const Effect& Astigmatism() {
  static const AstigmatismEffect effect;
  return effect;
}
const Effect& FieldCurvature() {
  static const FieldCurvatureEffect effect;
  return effect;
}

}  // namespace sightline
