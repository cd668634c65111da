// SPDX-License-Identifier: Apache-2.0
// Effects on the plate's functions: closed forms, conservation of light.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/random/counter_random.h"
#include "tests/render_worker/effects/test_frame.h"

namespace sightline {
namespace {

PlateScene SceneAfter(const std::string& id,
                      const std::vector<std::pair<std::string, double>>& values,
                      const FrameSetup& frame = TestFrame()) {
  PlateScene scene = TestScene(frame);
  const Effect& effect = TheEffect(id);
  effect.OnPlate(scene, frame, WithParameters(effect, values));
  return scene;
}

constexpr double kStep_m = 2e-6;

// Integrals over s at X of E, s E and s^2 E.
struct Moments {
  double power = 0, centre = 0, deviation = 0;
};
Moments MomentsAcross(const PlateFunction& function, double x_m, double half_width_m = 0.02) {
  Moments m;
  double second = 0;
  const double middle = TestFrame().plate.line_offset_m;
  for (double s = middle - half_width_m; s < middle + half_width_m; s += kStep_m) {
    const double e = function(x_m, s);
    m.power += e * kStep_m;
    m.centre += e * s * kStep_m;
    second += e * s * s * kStep_m;
  }
  m.centre /= m.power;
  m.deviation = std::sqrt(second / m.power - m.centre * m.centre);
  return m;
}

Moments Null() { return MomentsAcross(TestScene(TestFrame()).laser_irradiance_w_m2, 0); }

TEST(BeamShape, KeepsPowerAndWidthAtTheShoulder) {
  const FrameSetup frame = TestFrame();
  const double w = BeamRadius(frame.laser, frame.plate.laser_distance_m) / std::numbers::sqrt2 * 2;
  for (const double n : {1.5, 3.0, 6.0}) {
    const PlateScene scene = SceneAfter("illumination.beam_shape", {{"shape_exponent", n}});
    EXPECT_NEAR(MomentsAcross(scene.laser_irradiance_w_m2, 0).power / Null().power, 1, 1e-4);
    const double s0 = frame.plate.line_offset_m;
    // cos(45 deg): w on the plate is sqrt(2) w; there the profile is exp(-2) of the crest.
    EXPECT_NEAR(scene.laser_irradiance_w_m2(0, s0 + w) / scene.laser_irradiance_w_m2(0, s0),
                std::exp(-2.0), 1e-9);
    EXPECT_NEAR(scene.laser_irradiance_w_m2(0, s0 - 0.5 * w) / scene.laser_irradiance_w_m2(0, s0),
                std::exp(-2 * std::pow(0.5, n)), 1e-9);
  }
}

TEST(GhostLine, SharesThePowerAndLiesAtItsAngle) {
  const PlateScene scene =
      SceneAfter("illumination.ghost_line", {{"ghost_relative", 0.25}, {"ghost_offset_m", 3e-3}});
  const Moments m = MomentsAcross(scene.laser_irradiance_w_m2, 0);
  EXPECT_NEAR(m.power / Null().power, 1, 1e-9);
  // Centroid: a fifth of the light at 3 mm across the beam at 0.4 m, at 45 degrees.
  const double offset = 3e-3 * 0.39 / 0.4 * std::numbers::sqrt2;
  EXPECT_NEAR(m.centre - TestFrame().plate.line_offset_m, 0.2 * offset, 1e-9);
}

TEST(SubsurfaceScattering, SpreadsByTheExponentialKernel) {
  const double l = 2.5e-4, f = 0.3;
  const PlateScene scene =
      SceneAfter("surface.subsurface_scattering", {{"scattered_fraction", f}, {"spread_m", l}});
  const Moments null = Null();
  const Moments m = MomentsAcross(scene.laser_irradiance_w_m2, 0, 8e-3);
  // 1e-4: cubic interpolation of the table.
  EXPECT_NEAR(m.power / null.power, 1, 1e-4);
  EXPECT_NEAR(m.centre, null.centre, 1e-7);
  // The kernel's variance is 2 l^2.
  EXPECT_NEAR(m.deviation * m.deviation / (null.deviation * null.deviation + f * 2 * l * l), 1,
              1e-3);
  // Far away only the exponential is left: f power exp(s0^2 .../l)... its ratio over a distance.
  const double s0 = TestFrame().plate.line_offset_m;
  const double a = scene.laser_irradiance_w_m2(0, s0 + 2.5e-3);
  const double b = scene.laser_irradiance_w_m2(0, s0 + 3.0e-3);
  EXPECT_NEAR(std::log(a / b) / (0.5e-3 / l), 1, 1e-3);
}

TEST(SubsurfaceScattering, FollowsALineThatChangesAlongX) {
  const FrameSetup frame = TestFrame();
  PlateScene scene = SceneAfter("illumination.line_nonuniformity", {{"slope_relative", 0.5}});
  const Moments left = MomentsAcross(scene.laser_irradiance_w_m2, -1e-3);
  const Effect& effect = TheEffect("surface.subsurface_scattering");
  effect.OnPlate(scene, frame, WithParameters(effect, {{"scattered_fraction", 1}}));
  EXPECT_NEAR(MomentsAcross(scene.laser_irradiance_w_m2, -1e-3).power / left.power, 1, 1e-3);
}

TEST(LineNonuniformity, SlopeToTheEndOfTheLine) {
  const PlateScene scene = SceneAfter("illumination.line_nonuniformity", {{"slope_relative", 0.2}});
  const double end = 0.39 * std::tan(0.375);
  const double s0 = TestFrame().plate.line_offset_m;
  EXPECT_NEAR(scene.laser_irradiance_w_m2(end, s0) / scene.laser_irradiance_w_m2(0, s0), 1.2,
              1e-12);
  EXPECT_NEAR(scene.laser_irradiance_w_m2(-end, s0) / scene.laser_irradiance_w_m2(0, s0), 0.8,
              1e-12);
  EXPECT_FALSE(scene.constant_along_line);
}

TEST(LineBow, SagittaAtTheEnd) {
  const PlateScene scene = SceneAfter("illumination.line_bow", {{"bow_m", 1e-3}});
  const double end = 0.39 * std::tan(0.375);
  EXPECT_NEAR(MomentsAcross(scene.laser_irradiance_w_m2, end).centre - Null().centre, 1e-3, 1e-8);
  EXPECT_NEAR(MomentsAcross(scene.laser_irradiance_w_m2, end / 2).centre - Null().centre, 0.25e-3,
              1e-8);
}

TEST(Roll, CameraAndLaserTurnTheLineTheSameWay) {
  const double roll = 2, slope = std::tan(2 * std::numbers::pi / 180);
  const PlateScene laser = SceneAfter("geometry.laser_roll", {{"roll_deg", roll}});
  EXPECT_NEAR(MomentsAcross(laser.laser_irradiance_w_m2, 0.01).centre - Null().centre, 0.01 * slope,
              1e-7);
  // A point of the sensor on the rolled row looks at the row v = 0.
  const PlateScene camera = SceneAfter("geometry.camera_roll", {{"roll_deg", roll}});
  EXPECT_NEAR(camera.image_mapping({1e-3, 1e-3 * slope}).v_m, 0, 1e-15);
}

// A tilted plate is a triangulation target: the line moves by h tan(theta).
TEST(TiltedPlate, LineMovesAsTriangulationSays) {
  const FrameSetup frame = TestFrame();
  const PlateScene scene = SceneAfter("surface.tilted_plate", {{"tilt_deg", 3}});
  const double h = 0.01 * std::tan(3 * std::numbers::pi / 180);
  EXPECT_NEAR(scene.height_m(0.01, 0), h, 1e-15);
  const Moments m = MomentsAcross(scene.laser_irradiance_w_m2, 0.01);
  EXPECT_NEAR(m.centre - Null().centre, h, 1e-7);  // tan 45 deg = 1
  // Power in the line over its length is kept: P/L with L at the true distance.
  EXPECT_NEAR(m.power / Null().power, 0.39 / (0.39 - h * std::numbers::sqrt2), 1e-5);
}

TEST(CurvedPlate, SagittaOfAParabola) {
  EXPECT_NEAR(SceneAfter("surface.curved_plate", {{"curvature_per_m", 2}}).height_m(0.02, 0.01),
              2 * (4e-4 + 1e-4) / 2, 1e-15);
}

TEST(AlbedoTexture, HasItsVarianceAndCorrelationLength) {
  const double l = 5e-4, rms = 0.1;
  const PlateScene null = TestScene(TestFrame());
  double mean = 0, square = 0, product = 0;
  constexpr int kPlaces = 20000;
  int count = 0;
  for (int plate = 0; plate < 4; ++plate) {
    FrameSetup frame = TestFrame();
    frame.seeds.speckle = 50 + plate;
    frame.seeds.rig = 70 + plate;
    const PlateScene scene = SceneAfter(
        "surface.albedo_texture", {{"texture_rms_relative", rms}, {"texture_length_m", l}}, frame);
    for (int i = 0; i < kPlaces; ++i) {
      CounterRandom random(3, i);
      const double x = 0.06 * random.Uniform(), s = 0.06 * random.Uniform();
      const double a = scene.brdf_per_sr(x, s) / null.brdf_per_sr(x, s) - 1;
      const double b = scene.brdf_per_sr(x + l, s) / null.brdf_per_sr(x, s) - 1;
      mean += a;
      square += a * a;
      product += a * b;
      ++count;
    }
  }
  // 128 correlation lengths square hold about (120)^2/pi independent patches: standard error of the
  // variance sqrt(2/4600) a plate, four plates: 1 %.
  EXPECT_NEAR(std::sqrt(square / count) / rms, 1, 0.02);
  EXPECT_NEAR(mean / count, 0, 4 * rms / std::sqrt(4 * 4600.0));
  EXPECT_NEAR(product / square, std::exp(-1.0), 0.04);
}

// Another plate position sees another part of the texture, the same position the same.
TEST(AlbedoTexture, BelongsToThePlate) {
  FrameSetup frame = TestFrame();
  const auto value = [&] {
    return SceneAfter("surface.albedo_texture", {{"texture_rms_relative", 0.1}}, frame)
        .brdf_per_sr(1e-3, 2e-3);
  };
  const double first = value();
  frame.seeds.noise += 1;
  EXPECT_EQ(value(), first);
  frame.seeds.speckle += 1;
  EXPECT_NE(value(), first);
}

TEST(AmbientLight, GradientReachesTheEdgeOfTheSensor) {
  const FrameSetup frame = TestFrame();
  const PlateScene scene =
      SceneAfter("illumination.ambient_light", {{"ambient_radiance_w_m2_sr", 0.01},
                                                {"gradient_u_relative", 0.3},
                                                {"gradient_v_relative", -0.2}});
  const double per_px =
      frame.sensor.pixel_pitch_m * frame.plate.camera_distance_m / frame.ImageDistance();
  EXPECT_NEAR(scene.ambient_radiance_w_m2_sr(640 * per_px, 0), 0.013, 1e-12);
  EXPECT_NEAR(scene.ambient_radiance_w_m2_sr(0, 512 * per_px), 0.008, 1e-12);
  EXPECT_NEAR(scene.ambient_radiance_w_m2_sr(0, 0), 0.01, 1e-15);
}

TEST(AmbientFlicker, IsTheMeanOverTheExposure) {
  const FrameSetup frame = TestFrame();
  const double f = 87, depth = 0.6;
  const PlateScene scene = SceneAfter(
      "time.ambient_flicker",
      {{"ambient_radiance_w_m2_sr", 0.02}, {"flicker_depth", depth}, {"flicker_frequency_hz", f}});
  double mean = 0;
  constexpr int kSteps = 10000;
  for (int i = 0; i < kSteps; ++i) {
    const double t = frame.timestamp_s + frame.exposure_time_s * (i + 0.5) / kSteps;
    mean += 0.02 * (1 + depth * std::cos(2 * std::numbers::pi * f * t)) / kSteps;
  }
  EXPECT_NEAR(scene.ambient_radiance_w_m2_sr(0, 0), mean, 1e-8);
}

TEST(RollingShutter, EveryRowSeesFlickerAtItsOwnTime) {
  FrameSetup frame = TestFrame();
  const Effect& shutter = TheEffect("sensor.rolling_shutter");
  shutter.OnFrame(frame, WithParameters(shutter, {{"row_time_s", 1e-4}}));
  const Effect& flicker = TheEffect("time.ambient_flicker");
  const std::vector<double> strength = WithParameters(
      flicker,
      {{"ambient_radiance_w_m2_sr", 0.02}, {"flicker_depth", 0.6}, {"flicker_frequency_hz", 87}});
  const double m_per_row =
      frame.sensor.pixel_pitch_m * frame.plate.camera_distance_m / frame.ImageDistance();
  PlateScene rolling;
  flicker.OnPlate(rolling, frame, strength);
  for (int row : {0, 40, 100}) {
    // The same row, read by a global shutter at the time at which this row starts.
    FrameSetup later = frame;
    later.row_time_s = 0;
    later.timestamp_s += row * 1e-4;
    PlateScene global;
    flicker.OnPlate(global, later, strength);
    const double s_m = (frame.roi.row_px + row) * m_per_row;
    EXPECT_NEAR(rolling.ambient_radiance_w_m2_sr(0, s_m), global.ambient_radiance_w_m2_sr(0, s_m),
                1e-9)
        << "row " << row;
  }
}

// The sensor's signal of the fluorescing line, along s, is its fraction of the laser's radiance.
TEST(Fluorescence, IsAFractionOfTheLasersLight) {
  const FrameSetup frame = TestFrame();
  const PlateScene scene = SceneAfter("surface.fluorescence", {{"fluorescence_relative", 0.15}});
  const double laser = Null().power * scene.brdf_per_sr(0, 0);
  EXPECT_NEAR(MomentsAcross(scene.ambient_radiance_w_m2_sr, 0, 8e-3).power / (0.15 * laser), 1,
              1e-3);
  // Defocused by 0.1 m: wider, the same power.
  FrameSetup defocused = frame;
  defocused.lens.f_number = 2;
  defocused.lens.focus_distance_m = 0.243;
  const PlateScene blurred =
      SceneAfter("surface.fluorescence", {{"fluorescence_relative", 0.15}}, defocused);
  const Moments m = MomentsAcross(blurred.ambient_radiance_w_m2_sr, 0, 8e-3);
  EXPECT_NEAR(m.power / (0.15 * laser), 1, 1e-3);
  // Variance of the disc is R^2/4, of the pixel p^2/12; R on the plate by similar triangles from
  // the focused distance: D/2 (d - d_foc)/d_foc.
  const double radius = 0.004 * (0.343 - 0.243) / 0.243;
  const double pixel = frame.sensor.pixel_pitch_m * 0.343 / defocused.ImageDistance();
  const double expected = std::pow(Null().deviation, 2) + radius * radius / 4 + pixel * pixel / 12;
  EXPECT_NEAR(m.deviation * m.deviation / expected, 1, 2e-3);
}

TEST(RadialDistortion, InvertsTheForwardFormula) {
  for (const double k : {0.05, -0.05}) {
    const PlateScene scene = SceneAfter("optics.radial_distortion", {{"k1_relative", k}});
    for (const double r : {0.5e-3, 3e-3, 6e-3}) {
      const double distorted = r * (1 + k * std::pow(r / 5e-3, 2));
      const SensorPoint ideal = scene.image_mapping({0.6 * distorted, -0.8 * distorted});
      EXPECT_NEAR(ideal.u_m, 0.6 * r, 1e-12);
      EXPECT_NEAR(ideal.v_m, -0.8 * r, 1e-12);
    }
  }
}

TEST(TangentialDistortion, InvertsTheForwardFormula) {
  const double p1 = 0.004, p2 = -0.003;
  const PlateScene scene =
      SceneAfter("optics.tangential_distortion", {{"p1_relative", p1}, {"p2_relative", p2}});
  const double u = 0.7, v = -0.4, r2 = u * u + v * v;
  const SensorPoint ideal =
      scene.image_mapping({5e-3 * (u + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)),
                           5e-3 * (v + p1 * (r2 + 2 * v * v) + 2 * p2 * u * v)});
  EXPECT_NEAR(ideal.u_m, 5e-3 * u, 1e-12);
  EXPECT_NEAR(ideal.v_m, 5e-3 * v, 1e-12);
}

}  // namespace
}  // namespace sightline
