// SPDX-License-Identifier: Apache-2.0
// Effects that change numbers of the frame: sign and size.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/render_worker/effects/test_frame.h"

namespace sightline {
namespace {

FrameSetup FrameAfter(const std::string& id,
                      const std::vector<std::pair<std::string, double>>& values,
                      FrameSetup frame = TestFrame()) {
  const Effect& effect = TheEffect(id);
  effect.OnFrame(frame, WithParameters(effect, values));
  return frame;
}

TEST(FrameEffects, PowerDriftDecays) {
  FrameSetup frame = TestFrame();
  for (const double t : {0.0, 100.0, 1000.0}) {
    frame.timestamp_s = t;
    const FrameSetup after = FrameAfter("illumination.power_drift",
                                        {{"drift_relative", 0.2}, {"drift_time_s", 250}}, frame);
    EXPECT_DOUBLE_EQ(after.laser.power_w / frame.laser.power_w, 1 + 0.2 * std::exp(-t / 250));
  }
}

// Half of the light at the acceptance's own f-number, all of it at high ones; 1 / (1 + 0.5^2) at
// twice the f-number for the order 2. The dark signal is no light.
TEST(FrameEffects, MicroLensesLoseLightOfWideCones) {
  const auto accepted = [](double f_number, double acceptance, double order) {
    FrameSetup frame = TestFrame();
    frame.lens.f_number = f_number;
    const FrameSetup after =
        FrameAfter("sensor.micro_lens_vignetting",
                   {{"acceptance_f_number", acceptance}, {"roll_off_order", order}}, frame);
    EXPECT_EQ(after.sensor.dark_mean_electrons, frame.sensor.dark_mean_electrons);
    EXPECT_EQ(after.lens.f_number, f_number);
    const double wavelength_m = frame.laser.wavelength_m;
    const double ratio = after.sensor.quantum_efficiency[0].At(wavelength_m) /
                         frame.sensor.quantum_efficiency[0].At(wavelength_m);
    // All colours alike.
    EXPECT_DOUBLE_EQ(after.sensor.quantum_efficiency[1].At(wavelength_m),
                     ratio * frame.sensor.quantum_efficiency[1].At(wavelength_m));
    return ratio;
  };
  EXPECT_DOUBLE_EQ(accepted(1.4, 1.4, 4), 0.5);
  EXPECT_DOUBLE_EQ(accepted(2.8, 1.4, 2), 0.8);
  EXPECT_NEAR(accepted(16, 1.4, 4), 1, 1e-4);
  EXPECT_LT(accepted(1.4, 0.7, 4), accepted(2.0, 0.7, 4));
}

// Mean and spread over many recordings; 4 standard errors of each.
TEST(FrameEffects, PowerNoiseAndExposureJitterScatterAsStated) {
  constexpr int kFrames = 4000;
  const double sigma = 0.03;
  double mean[2] = {0, 0}, square[2] = {0, 0};
  for (int i = 0; i < kFrames; ++i) {
    FrameSetup frame = TestFrame();
    frame.seeds.noise = 100 + i;
    const double power =
        FrameAfter("illumination.power_noise", {{"power_noise_relative", sigma}}, frame)
                .laser.power_w /
            frame.laser.power_w -
        1;
    const double time = (FrameAfter("time.exposure_jitter",
                                    {{"exposure_jitter_s", sigma * frame.exposure_time_s}}, frame)
                             .exposure_time_s -
                         frame.exposure_time_s) /
                        frame.exposure_time_s;
    mean[0] += power / kFrames;
    mean[1] += time / kFrames;
    square[0] += power * power / kFrames;
    square[1] += time * time / kFrames;
  }
  for (int k = 0; k < 2; ++k) {
    EXPECT_NEAR(mean[k], 0, 4 * sigma / std::sqrt(kFrames));
    EXPECT_NEAR(square[k] / (sigma * sigma), 1, 4 * std::sqrt(2.0 / kFrames));
  }
}

TEST(FrameEffects, FactorsAndShifts) {
  const FrameSetup frame = TestFrame();
  EXPECT_DOUBLE_EQ(FrameAfter("optics.f_number_error", {{"f_number_factor", 0.8}}).PupilDiameter(),
                   frame.PupilDiameter() / 0.8);
  EXPECT_DOUBLE_EQ(
      *FrameAfter("optics.focus_error", {{"focus_distance_factor", 1.1}}).lens.focus_distance_m,
      0.34 * 1.1);
  EXPECT_DOUBLE_EQ(
      FrameAfter("optics.transmission_error", {{"amplitude_factor", 0.7}}).lens.transmission, 0.63);
  EXPECT_DOUBLE_EQ(FrameAfter("illumination.beam_quality", {{"m2", 2}}).laser.beam_quality_m2, 2);
  EXPECT_DOUBLE_EQ(FrameAfter("illumination.beam_focus", {{"beam_focus_shift_m", 0.02}})
                       .laser.beam_focus_distance_m,
                   0.45);
  EXPECT_DOUBLE_EQ(FrameAfter("geometry.incidence_angle_error", {{"incidence_shift_deg", 3}})
                       .plate.incidence_angle_rad,
                   frame.plate.incidence_angle_rad + 3 * std::numbers::pi / 180);
  EXPECT_DOUBLE_EQ(FrameAfter("geometry.camera_distance_error", {{"camera_distance_shift_m", 0.01}})
                       .plate.camera_distance_m,
                   0.353);
  EXPECT_EQ(FrameAfter("optics.polygon_aperture", {{"blades", 6}}).lens.aperture_blades, 6);
  EXPECT_DOUBLE_EQ(FrameAfter("sensor.dark_current", {{"dark_current_electrons_per_s", 17}})
                       .sensor.dark_current_electrons_per_s,
                   17);
  EXPECT_DOUBLE_EQ(FrameAfter("time.temperature_drift", {{"dark_drift_electrons_per_s", 0.01}})
                       .sensor.dark_mean_electrons,
                   15 + 1.234);
  EXPECT_DOUBLE_EQ(FrameAfter("sensor.lower_full_well", {{"full_well_electrons", 3000}})
                       .sensor.saturation_capacity_electrons,
                   3000);
  EXPECT_DOUBLE_EQ(
      FrameAfter("time.exposure_offset", {{"exposure_offset_s", -0.1}}).exposure_time_s, 0);
  // Independent variances add.
  EXPECT_DOUBLE_EQ(FrameAfter("sensor.prnu", {{"prnu_relative", 0.008}}).sensor.prnu_relative,
                   0.01);
}

TEST(FrameEffects, QuantumEfficiencyOfTheColours) {
  FrameSetup colour = FrameAfter("sensor.qe_error", {{"qe_factor", 0.9}, {"qe_factor_blue", 1.2}});
  EXPECT_DOUBLE_EQ(colour.sensor.quantum_efficiency[kRed].At(600e-9), 0.45);
  EXPECT_DOUBLE_EQ(colour.sensor.quantum_efficiency[kGreen].At(600e-9), 0.5);
  EXPECT_DOUBLE_EQ(colour.sensor.quantum_efficiency[kBlue].At(600e-9), 0.6);
  FrameSetup mono = TestFrame();
  mono.sensor.colour_filter = ColourFilter::kMono;
  mono = FrameAfter("sensor.colour_response_error", {{"qe_factor_green", 2}}, mono);
  EXPECT_DOUBLE_EQ(mono.sensor.quantum_efficiency[0].At(600e-9), 0.5);
}

// The pixel's distortion on the plate and on a part must be the same: Brown and Conrady's
// coefficient belongs to the radius in units of the image distance.
TEST(FrameEffects, DistortionOfPartsHasTheSameRadius) {
  const FrameSetup frame = TestFrame();
  const double b = frame.ImageDistance();
  const double k =
      FrameAfter("optics.radial_distortion", {{"k1_relative", 0.02}}).lens.distortion.k1;
  const double r = 3e-3;
  EXPECT_NEAR(k * (r / b) * (r / b), 0.02 * (r / 5e-3) * (r / 5e-3), 1e-15);
}

}  // namespace
}  // namespace sightline
