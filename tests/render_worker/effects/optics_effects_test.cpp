// SPDX-License-Identifier: Apache-2.0
// Effects on pupil, transfer functions, speckle and fixed patterns of light.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/render_worker/effects/test_frame.h"

namespace sightline {
namespace {

constexpr double kPi = std::numbers::pi;

OpticsModel OpticsAfter(const std::string& id,
                        const std::vector<std::pair<std::string, double>>& values,
                        const FrameSetup& frame = TestFrame()) {
  OpticsModel optics = TestOptics(frame);
  const Effect& effect = TheEffect(id);
  effect.OnOptics(optics, frame, WithParameters(effect, values));
  return optics;
}

SpeckleModel Speckle(const std::string& id,
                     const std::vector<std::pair<std::string, double>>& values,
                     const FrameSetup& frame = TestFrame()) {
  SpeckleModel speckle;
  const Effect& effect = TheEffect(id);
  effect.OnSpeckle(speckle, frame, WithParameters(effect, values));
  return speckle;
}

double ContrastSquared(const SpeckleModel& speckle) {
  double sum = 0, square = 0;
  for (const double weight : speckle.pattern_weights) {
    sum += weight;
    square += weight * weight;
  }
  EXPECT_NEAR(sum, 1, 1e-14);
  return square;
}

// Hankel transform of the halo, by quadrature.
TEST(VeilingGlare, IsTheTransformOfItsHalo) {
  const double g = 0.12, r0 = 1.5e-4;
  const OpticsModel optics =
      OpticsAfter("optics.veiling_glare", {{"glare_fraction", g}, {"halo_radius_m", r0}});
  EXPECT_NEAR(Transfer(optics, 0, 0).real(), 1, 1e-15);  // no light is lost
  for (const double q : {200.0, 1000.0, 4000.0}) {
    double halo = 0;
    const double step = r0 / 200;
    for (double r = 0.5 * step; r < 40 * r0; r += step) {
      halo += std::exp(-r / r0) / (2 * kPi * r0 * r0) * std::cyl_bessel_j(0, 2 * kPi * q * r) * 2 *
              kPi * r * step;
    }
    EXPECT_NEAR(Transfer(optics, 0.6 * q, 0.8 * q).real(), 1 - g + g * halo, 1e-5);
  }
}

TEST(VeilingGlare, MoreGlareLessContrast) {
  double before = 1;
  for (const double g : {0.02, 0.1, 0.3}) {
    const double now =
        Transfer(OpticsAfter("optics.veiling_glare", {{"glare_fraction", g}}), 0, 3000).real();
    EXPECT_LT(now, before);
    before = now;
  }
}

TEST(LensReflection, IsADisplacedCopyThatKeepsTheLight) {
  const OpticsModel optics = OpticsAfter("optics.lens_reflection", {{"reflection_relative", 0.1}});
  EXPECT_NEAR(std::abs(Transfer(optics, 0, 0) - 1.0), 0, 1e-15);
  double least = 1, largest = 0;
  for (double q = 0; q < 50000; q += 50) {
    const double magnitude = std::abs(Transfer(optics, q, 0.7 * q));
    least = std::min(least, magnitude);
    largest = std::max(largest, magnitude);
  }
  EXPECT_NEAR(least, (1 - 0.1) / 1.1, 1e-3);
  EXPECT_NEAR(largest, 1, 1e-3);
  // Real images: opposite frequencies are conjugate.
  EXPECT_NEAR(std::abs(Transfer(optics, 900, -300) - std::conj(Transfer(optics, -900, 300))), 0,
              1e-15);
}

TEST(VibrationBlur, WholePeriodsGiveABesselFunction) {
  FrameSetup frame = TestFrame();
  frame.exposure_time_s = 0.1;
  const OpticsModel optics =
      OpticsAfter("time.vibration_blur",
                  {{"vibration_amplitude_px", 1.5}, {"vibration_frequency_hz", 200}}, frame);
  const double a = 1.5 * frame.sensor.pixel_pitch_m;
  for (const double q : {0.0, 1e4, 5e4, 2e5}) {
    EXPECT_NEAR(std::abs(Transfer(optics, 123, q) - std::cyl_bessel_j(0, 2 * kPi * q * a)), 0,
                1e-12);
  }
}

// Interpolated and, far out, summed up: on both sides of where that changes.
TEST(VibrationBlur, IsTheSameFunctionNearAndFar) {
  FrameSetup frame = TestFrame();
  frame.exposure_time_s = 0.1;
  const OpticsModel optics =
      OpticsAfter("time.vibration_blur",
                  {{"vibration_amplitude_px", 8}, {"vibration_frequency_hz", 50}}, frame);
  const double a = 8 * frame.sensor.pixel_pitch_m;
  // Sums over 32 moments of a quarter period are Bessel functions up to arguments of some 80.
  for (const double x : {-70.0, -1e-3, 0.1, 3.0, 17.3, 70.0}) {
    EXPECT_NEAR(
        std::abs(Transfer(optics, 0, x / (2 * kPi * a)) - std::cyl_bessel_j(0, std::abs(x))), 0,
        1e-12)
        << x;
  }
  const double before = Transfer(optics, 0, 255.999 / (2 * kPi * a)).real();
  const double here = Transfer(optics, 0, 256 / (2 * kPi * a)).real();
  const double after = Transfer(optics, 0, 256.001 / (2 * kPi * a)).real();
  EXPECT_NEAR(here, 0.5 * (before + after), 1e-6);  // curvature
}

TEST(VibrationBlur, PartOfAPeriodIsTheMeanOverTheExposure) {
  FrameSetup frame = TestFrame();
  frame.exposure_time_s = 0.0137;
  const OpticsModel optics =
      OpticsAfter("time.vibration_blur",
                  {{"vibration_amplitude_px", 2}, {"vibration_frequency_hz", 100}}, frame);
  // The phase is not known here: compare the largest agreement over all phases.
  const double a = 2 * frame.sensor.pixel_pitch_m;
  double best = 1;
  for (int k = 0; k < 2000; ++k) {
    double worst = 0;
    for (const double q : {2e4, 6e4}) {
      std::complex<double> mean = 0;
      constexpr int kSteps = 500;
      for (int i = 0; i < kSteps; ++i) {
        const double t = frame.exposure_time_s * (i + 0.5) / kSteps;
        mean +=
            std::polar(1.0 / kSteps, -2 * kPi * q * a * std::sin(2 * kPi * (100 * t + k / 2000.0)));
      }
      worst = std::max(worst, std::abs(mean - Transfer(optics, 0, q)));
    }
    best = std::min(best, worst);
  }
  // Steps of the phase: 2 pi q a 2 pi/2000/2 = 6e-3 at most.
  EXPECT_LT(best, 7e-3);
}

TEST(Aberrations, HaveTheirSeidelForm) {
  const FrameSetup frame = TestFrame();
  const double lambda = frame.laser.wavelength_m;
  const double full = 0.016 / 1.4 / 2;
  const double x = 0.3e-3, y = 1.1e-3, r = std::hypot(x, y);
  EXPECT_NEAR(OpticsAfter("optics.spherical_aberration", {{"w040_waves", 2}})
                  .pupil(1e-3, 2e-3)
                  .WavefrontError(x, y),
              2 * lambda * std::pow(r / full, 4), 1e-15);
  const double u = 3e-3, v = -4e-3;  // h = 5 mm
  const double cosine = (x * u + y * v) / (r * 5e-3);
  EXPECT_NEAR(OpticsAfter("optics.coma", {{"w131_waves", 2}}).pupil(u, v).WavefrontError(x, y),
              2 * lambda * std::pow(r / full, 3) * cosine, 1e-15);
  EXPECT_NEAR(OpticsAfter("optics.astigmatism", {{"w222_waves", 2}})
                  .pupil(u / 2, v / 2)
                  .WavefrontError(x, y),
              2 * lambda * 0.25 * std::pow(r / full * cosine, 2), 1e-15);
  // Field curvature is in the curvature C of W = -1/2 C r^2.
  const OpticsModel field = OpticsAfter("optics.field_curvature", {{"w220_waves", 2}});
  const double curvature = field.curvature(0.3, u, v) - field.curvature(0.3, 0, 0);
  EXPECT_NEAR(-0.5 * curvature * r * r, 2 * lambda * std::pow(r / full, 2), 1e-15);
  EXPECT_TRUE(field.field_dependent);
  EXPECT_FALSE(OpticsAfter("optics.spherical_aberration", {{"w040_waves", 2}}).field_dependent);
}

// Focus at u is what a sensor at b + u tan(tilt) would have.
TEST(SensorTilt, MovesTheFocusAlongTheRow) {
  FrameSetup frame = TestFrame();
  const OpticsModel optics = OpticsAfter("geometry.sensor_tilt", {{"sensor_tilt_deg", 4}});
  const double local = frame.ImageDistance() + 2e-3 * std::tan(4 * kPi / 180);
  EXPECT_NEAR(optics.curvature(0.31, 2e-3, 1e-3), 1 / 0.016 - 1 / 0.31 - 1 / local, 1e-9);
  EXPECT_EQ(optics.curvature(0.31, 0, 1e-3), TestOptics(frame).curvature(0.31, 0, 0));
}

TEST(MechanicalVignetting, CutsOffAxisOnly) {
  const OpticsModel optics =
      OpticsAfter("optics.mechanical_vignetting",
                  {{"rim_radius_m", 2.5e-3}, {"rim_shift_per_tangent_m", 0.008}});
  EXPECT_TRUE(optics.pupil(0, 0).clips.empty());  // f/4: the pupil's radius is 2 mm
  const Pupil pupil = optics.pupil(4e-3, 0);
  ASSERT_EQ(pupil.clips.size(), 1);
  EXPECT_NEAR(pupil.clips[0].centre_u_m, 0.008 * 4e-3 / optics.image_distance_m, 1e-12);
  EXPECT_LT(ClearFraction(pupil), 1);
  EXPECT_LT(ClearFraction(optics.pupil(5e-3, 0)), ClearFraction(pupil));
}

TEST(MechanicalVignetting, RimThatCutsNothingLeavesTheLensAsItIs) {
  // The corner of the sensor sees the rim shifted by less than what is left between the two.
  const FrameSetup frame = TestFrame();
  const double corner_m =
      0.5 * frame.sensor.pixel_pitch_m * std::hypot(frame.sensor.columns_px, frame.sensor.rows_px);
  const double shift_at_corner_m = 0.008 * corner_m / TestOptics(frame).image_distance_m;
  for (const double room : {0.99, 1.01}) {
    const OpticsModel optics = OpticsAfter(
        "optics.mechanical_vignetting",
        {{"rim_radius_m", 2e-3 + room * shift_at_corner_m}, {"rim_shift_per_tangent_m", 0.008}});
    EXPECT_EQ(optics.field_dependent, room < 1) << room;
  }
}

TEST(SpecklePatterns, ContrastOfModesAndPolarisation) {
  for (const double modes : {1.0, 1.3, 2.0, 2.7, 5.0, 12.4}) {
    EXPECT_NEAR(ContrastSquared(Speckle("illumination.partial_coherence", {{"modes", modes}})),
                1 / modes, 1e-12);
  }
  for (const double p : {1.0, 0.5, 0.0}) {
    EXPECT_NEAR(ContrastSquared(Speckle("surface.depolarisation", {{"degree_of_polarisation", p}})),
                (1 + p * p) / 2, 1e-12);
  }
  // Both together multiply.
  SpeckleModel speckle = Speckle("illumination.partial_coherence", {{"modes", 3}});
  const Effect& effect = TheEffect("surface.depolarisation");
  effect.OnSpeckle(speckle, TestFrame(), std::vector<double>{0.0});
  EXPECT_NEAR(ContrastSquared(speckle), 1.0 / 6, 1e-12);
}

TEST(PlateMotion, MovesByMagnificationTimesSpeed) {
  const FrameSetup frame = TestFrame();
  const double v = 2e-3;
  const SpeckleModel speckle = Speckle("time.plate_motion", {{"plate_speed_m_s", v}});
  const double m = frame.ImageDistance() / frame.plate.camera_distance_m;
  double mean = 0;
  for (const SpeckleModel::Shift& shift : speckle.shifts) {
    mean += shift.u_m / static_cast<double>(speckle.shifts.size());
    EXPECT_EQ(shift.v_m, 0);
  }
  EXPECT_NEAR(mean / (m * v * (frame.timestamp_s + frame.exposure_time_s / 2)), 1, 1e-12);
  // Steps no longer than a third of a speckle.
  const double step = speckle.shifts[1].u_m - speckle.shifts[0].u_m;
  EXPECT_LE(step, frame.laser.wavelength_m * frame.ImageDistance() / frame.PupilDiameter() / 3);
}

PixelIrradiance EvenLight(const std::string& id,
                          const std::vector<std::pair<std::string, double>>& values,
                          const RegionOfInterest& roi) {
  FrameSetup frame = TestFrame();
  frame.roi = roi;
  PixelIrradiance light;
  light.roi = roi;
  light.laser_irradiance_w_m2 = Image<float>(roi.columns_px, roi.rows_px, 1.0F);
  light.incoherent_electron_flux_m2_s[0] = light.laser_irradiance_w_m2;
  const Effect& effect = TheEffect(id);
  effect.OnPixelIrradiance(light, frame, WithParameters(effect, values));
  return light;
}

TEST(CoverGlassEtalon, FringesHaveTheirPeriodAndVisibility) {
  const PixelIrradiance light =
      EvenLight("optics.cover_glass_etalon", {{"fringe_visibility", 0.2}, {"fringe_period_px", 25}},
                {-50, -5, 100, 10});
  float least = 2, largest = 0;
  double mean = 0;
  for (int j = 0; j < 100; ++j) {
    const float value = light.laser_irradiance_w_m2.At(3, j);
    least = std::min(least, value);
    largest = std::max(largest, value);
    mean += value / 100;
    EXPECT_EQ(value, light.laser_irradiance_w_m2.At(7, j));  // straight across
    if (j >= 25) {
      EXPECT_NEAR(value, light.laser_irradiance_w_m2.At(3, j - 25), 1e-6);
    }
    EXPECT_EQ(light.incoherent_electron_flux_m2_s[0].At(3, j), 1);
  }
  const double blur = std::sin(kPi / 25) / (kPi / 25);
  EXPECT_NEAR((largest - least) / (largest + least), 0.2 * blur, 0.2 * (1 - std::cos(kPi / 25)));
  EXPECT_NEAR(mean, 1, 1e-6);
}

// The variance about the mean of a block of columns, averaged over blocks of many phases.
TEST(CoverGlassEtalon, VarianceWithinABlockIsThatOfItsFringes) {
  const std::vector<std::pair<std::string, double>> values = {
      {"fringe_visibility", 0.2}, {"fringe_period_px", 90}, {"fringe_direction_deg", 40}};
  constexpr int kBlock = 60, kRows = 1200, kBlocks = 10;
  const PixelIrradiance light =
      EvenLight("optics.cover_glass_etalon", values, {-300, -600, kBlock * kBlocks, kRows});
  double variance = 0;
  for (int i = 0; i < kRows; ++i) {
    for (int b = 0; b < kBlocks; ++b) {
      double sum = 0, square = 0;
      for (int j = b * kBlock; j < (b + 1) * kBlock; ++j) {
        const double value = light.laser_irradiance_w_m2.At(i, j);
        sum += value;
        square += value * value;
      }
      variance += (square / kBlock - sum * sum / (kBlock * kBlock)) / (kRows * kBlocks);
    }
  }
  const Effect& effect = TheEffect("optics.cover_glass_etalon");
  const double stated = effect.VarianceWithinBlock(kBlock, WithParameters(effect, values));
  EXPECT_NEAR(variance, stated, 0.03 * stated);
  EXPECT_EQ(effect.VarianceWithinBlock(kBlock, WithParameters(effect, {})), 0);
}

// The pattern belongs to the sensor, not to the region that is read out.
TEST(FixedPatterns, DoNotDependOnTheRegion) {
  for (const char* id : {"optics.cover_glass_etalon", "optics.dust"}) {
    const std::vector<std::pair<std::string, double>> values =
        id == std::string("optics.dust")
            ? std::vector<std::pair<std::string, double>>{{"spots", 1000}}
            : std::vector<std::pair<std::string, double>>{{"fringe_visibility", 0.3},
                                                          {"fringe_direction_deg", 30}};
    const PixelIrradiance whole = EvenLight(id, values, {-60, -60, 120, 120});
    const PixelIrradiance part = EvenLight(id, values, {10, -20, 30, 40});
    for (int i = 0; i < 40; ++i) {
      for (int j = 0; j < 30; ++j) {
        EXPECT_EQ(part.laser_irradiance_w_m2.At(i, j),
                  whole.laser_irradiance_w_m2.At(i + 40, j + 70))
            << id;
      }
    }
  }
}

TEST(Dust, OnlyDarkensAndMoreSpotsAreDarker) {
  double before = 1e9;
  for (const double spots : {0.0, 200.0, 600.5, 1000.0}) {
    const PixelIrradiance light =
        EvenLight("optics.dust", {{"spots", spots}}, {-200, -200, 400, 400});
    double sum = 0;
    for (const float value : light.laser_irradiance_w_m2.values) {
      EXPECT_LE(value, 1);
      EXPECT_GT(value, 0);
      sum += value;
    }
    EXPECT_LT(sum, before);
    before = sum;
  }
}

TEST(NaturalVignetting, IsAPowerOfTheFieldAnglesCosine) {
  const PixelIrradiance light =
      EvenLight("optics.natural_vignetting", {{"extra_exponent", 2}}, {600, 0, 4, 2});
  const FrameSetup frame = TestFrame();
  const double tangent = 601 * frame.sensor.pixel_pitch_m / frame.ImageDistance();
  EXPECT_NEAR(light.laser_irradiance_w_m2.At(0, 1), 1 / (1 + tangent * tangent), 1e-6);
}

}  // namespace
}  // namespace sightline
