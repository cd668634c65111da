// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms of time: the exposure that a set time gives, and drifts.
#include <array>
#include <cmath>

#include "render_worker/effects/discrepancy/free_form_effect.h"

namespace sightline {
namespace {

class ExposureTerm final : public FreeFormEffect {
 public:
  ExposureTerm()
      : FreeFormEffect(
            "response",
            {.id = "unknown.exposure",
             .stage = Stage::kTime,
             .summary = "true exposure time t (t/1 ms)^a exp(b ln^2(t/1 ms)) + c",
             .reference = "EMVA 1288 R4.0 Linear, section 2.1 (exposure time)",
             .parameters = {Coefficient("exponent", 0.5, 0.02), Coefficient("bend", 0.1, 5e-3),
                            Coefficient("offset_s", 0.1, 2e-5)}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.exposure_time_s =
        std::max(0.0, frame.exposure_time_s * Factor(frame.exposure_time_s, p) + p[2]);
  }

  Axes CurveAxes() const override {
    Axes axes{"exposure_time_s", "true_over_set_exposure_time", {}};
    for (int k = -10; k <= 2; ++k) axes.abscissa_values.push_back(std::pow(10, 0.5 * k));
    return axes;
  }
  double CurveAt(double time_s, Parameters p) const override {
    return Factor(time_s, p) + p[2] / time_s;
  }

 private:
  static double Factor(double time_s, Parameters p) {
    if (!(time_s > 0)) return 1;
    const double log_time = std::log(time_s / 1e-3);
    return std::exp(log_time * (p[0] + p[1] * log_time));
  }
};

// Random deviations of the exposure, relatively largest at short ones; those of the power are the
// same at all exposures. It is random per recording (random_effect/law) and changes no expectation.
class ExposureScatterTerm final : public FreeFormEffect {
 public:
  ExposureScatterTerm()
      : FreeFormEffect("noise", {.id = "unknown.exposure_scatter",
                                 .stage = Stage::kTime,
                                 .kind = EffectKind::kRandomPerRecording,
                                 .random_law = RandomLaw::kScaledExposureTime,
                                 .summary = "exposures t scatter normally by s (1 ms/t)^a of "
                                            "themselves; a = 1: by a constant time",
                                 .reference = "EMVA 1288 R4.0 Linear, section 2.1 (exposure time)",
                                 .parameters = {{"exposure_scatter_relative", 0, 0, 0.5, 0.02},
                                                {"exponent", 1, 0.3, 3, 0.4}}}) {}
};

// Any movement across the line with a correlation time: jolts, drift, vibrations of several
// frequencies. It is random per recording (random_effect/law) and changes no expectation.
class MovementTerm final : public FreeFormEffect {
 public:
  MovementTerm()
      : FreeFormEffect("noise", {.id = "unknown.movement",
                                 .stage = Stage::kTime,
                                 .kind = EffectKind::kRandomPerRecording,
                                 .random_law = RandomLaw::kCorrelatedMovement,
                                 .summary = "image moves across the line normally by s, with "
                                            "correlation exp(-|time apart| / t)",
                                 .reference = "Uhlenbeck and Ornstein, Phys. Rev. 36 (1930) 823",
                                 .parameters = {{"movement_px", 0, 0, 50, 1},
                                                {"correlation_time_s", 0.01, 1e-5, 1e4, 0.09}}}) {}
};

class DarkCourseTerm final : public FreeFormEffect {
 public:
  DarkCourseTerm()
      : FreeFormEffect("time_course",
                       {.id = "unknown.dark_course",
                        .stage = Stage::kTime,
                        .summary = "mean dark signal piecewise linear in the time since the start",
                        .reference = "EMVA 1288 R4.0 Linear, section 3.2 (dark current and "
                                     "temperature)",
                        .parameters = {Coefficient("electrons_at_30_s", 1e3, 3),
                                       Coefficient("electrons_at_180_s", 1e3, 3),
                                       Coefficient("electrons_at_500_s", 1e3, 3),
                                       Coefficient("electrons_at_1000_s", 1e3, 3),
                                       Coefficient("electrons_at_1800_s", 1e3, 3)}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_mean_electrons += CurveAt(frame.timestamp_s, p);
  }

  Axes CurveAxes() const override {
    return {"timestamp_s", "dark_signal_electrons", EvenlySpaced(0, 2000, 81)};
  }
  double CurveAt(double timestamp_s, Parameters p) const override {
    static constexpr std::array<double, 5> kKnots_s = {30, 180, 500, 1000, 1800};
    return LinearThroughKnots(kKnots_s, p, timestamp_s);
  }
};

// The line stays where it is.
class MotionTerm final : public FreeFormEffect {
 public:
  MotionTerm()
      : FreeFormEffect("time_course",
                       {.id = "unknown.motion",
                        .stage = Stage::kTime,
                        .summary = "scatterers have moved along the line by a t + b t^2/1000 s "
                                   "since the start",
                        .reference = "Goodman, Speckle Phenomena in Optics, 2nd ed., section 5.3 "
                                     "(moving diffuser)",
                        .parameters = {Coefficient("speed_m_s", 0.1, 1e-5),
                                       Coefficient("growth_m_s", 0.1, 1e-5)}}) {}

  void OnSpeckle(SpeckleModel& speckle, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;
    const double image_scale = frame.ImageDistance() / frame.plate.camera_distance_m;
    for (SpeckleModel::Shift& shift : speckle.shifts) {
      shift.u_m += image_scale * CurveAt(frame.timestamp_s, p);
    }
  }

  Axes CurveAxes() const override {
    return {"timestamp_s", "way_along_line_m", EvenlySpaced(0, 2000, 81)};
  }
  double CurveAt(double timestamp_s, Parameters p) const override {
    return timestamp_s * (p[0] + p[1] * timestamp_s / 1000);
  }
};

}  // namespace

std::vector<const FreeFormEffect*> TimeTerms() {
  static const ExposureTerm exposure;
  static const ExposureScatterTerm exposure_scatter;
  static const MovementTerm movement;
  static const DarkCourseTerm dark_course;
  static const MotionTerm motion;
  return {&exposure, &exposure_scatter, &movement, &dark_course, &motion};
}

}  // namespace sightline
