// SPDX-License-Identifier: Apache-2.0
// Laws in the set-up: planted ones come back, noise gives none.
#include "render_worker/diagnosis/finding/setup_law/setup_law.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <set>
#include <string>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

// Some forty recordings as people take them: one quantity at a time, in random order, with the
// exposure time made up for aperture and distance.
std::vector<SetupAmplitude> Recordings(uint64_t seed) {
  std::vector<SetupAmplitude> all;
  CounterRandom random(seed, 77);
  const auto add = [&](double n, double d, double focus, double laser, double light, double field_m,
                       int burst) {
    SetupAmplitude a;
    a.f_number = n;
    a.camera_distance_m = d;
    a.focus_distance_m = focus;
    a.laser_distance_m = laser;
    a.exposure_time_s = 2e-5 * n * n * light;
    a.defocus_px = 2700 / n * std::abs(1 / d - 1 / focus) * 0.016;
    a.signal_level = 0.3 * std::min(light, 3.0);
    a.field_position_m = field_m;
    a.burst_frame_index = burst;
    a.row = 20 * (random.Uniform() - 0.5);
    a.timestamp_s = 50 + 40.0 * static_cast<double>(all.size()) + 20 * random.Uniform();
    all.push_back(a);
  };
  for (const double n : {1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 22.0}) {
    add(n, 0.35, 0.35, 0.4, 1, 0, 0);
  }
  for (const double d : {0.2, 0.25, 0.3, 0.4, 0.45, 0.5}) add(4, d, 0.35, 0.4, 1, 0, 0);
  for (const double d : {0.25, 0.5}) add(2, d, 0.35, 0.4, 1, 0, 0);
  for (const double focus : {0.25, 0.3, 0.48}) add(2.8, 0.35, focus, 0.4, 1, 0, 0);
  for (const double laser : {0.28, 0.52}) add(8, 0.35, 0.35, laser, 1, 0, 0);
  for (int k = 0; k < 9; ++k) add(8, 0.35, 0.35, 0.4, 0.1 * std::exp2(k * 5 % 9), 0, k);
  for (const double field : {4.5e-3, 5.6e-3, 4.8e-3, 3.3e-3})
    add(5.6, 0.35, 0.35, 0.4, 1, field, 0);
  for (int k = 0; k < 6; ++k) add(8, 0.35, 0.35, 0.4, 1, 0, 0);
  // In random order of time.
  for (size_t i = all.size() - 1; i > 0; --i) {
    std::swap(all[i].timestamp_s, all[static_cast<size_t>(random.Uniform() * (i + 1))].timestamp_s);
  }
  return all;
}

using Law = std::function<double(const SetupAmplitude&)>;

std::vector<SetupAmplitude> Plant(uint64_t seed, const Law& law, double standard_error) {
  std::vector<SetupAmplitude> all = Recordings(seed);
  CounterRandom random(seed, 78);
  for (SetupAmplitude& a : all) {
    a.standard_error = standard_error * (0.5 + random.Uniform());
    a.amplitude = law(a) + a.standard_error * random.Normal();
  }
  return all;
}

std::set<std::string> Quantities(const std::vector<v1::SetupLaw>& laws) {
  std::set<std::string> names;
  for (const v1::SetupLaw& law : laws) {
    if (!law.law().starts_with("or ")) names.insert(law.quantity());
  }
  return names;
}

void ExpectExponent(const std::vector<v1::SetupLaw>& laws, const std::string& quantity,
                    double exponent) {
  for (const v1::SetupLaw& law : laws) {
    if (law.quantity() != quantity || law.law().starts_with("or ")) continue;
    EXPECT_NEAR(law.exponent(), exponent, 3.5 * law.exponent_standard_error()) << law.law();
    EXPECT_LT(law.exponent_standard_error(), 0.3) << law.law();
    EXPECT_GT(law.exponent_standard_error(), 0) << law.law();
    return;
  }
  ADD_FAILURE() << quantity << " is missing";
}

TEST(SetupLaw, OneQuantity) {
  const auto dark = [](const SetupAmplitude& a) { return 100 * a.exposure_time_s; };
  auto laws = FindSetupLaws(Plant(1, dark, 0.02), {});
  EXPECT_EQ(Quantities(laws), std::set<std::string>{"exposure_time_s"}) << laws[0].law();
  ExpectExponent(laws, "exposure_time_s", 1);
  EXPECT_GT(laws[0].explained(), 0.9);
  EXPECT_TRUE(laws[0].law().starts_with("proportional to exposure_time_s^1 ")) << laws[0].law();

  const auto aperture = [](const SetupAmplitude& a) { return 0.3 * std::pow(a.f_number, -2); };
  laws = FindSetupLaws(Plant(2, aperture, 0.003), {});
  EXPECT_EQ(Quantities(laws), std::set<std::string>{"f_number"}) << laws[0].law();
  ExpectExponent(laws, "f_number", -2);

  const auto response = [](const SetupAmplitude& a) { return -0.1 * a.signal_level; };
  laws = FindSetupLaws(Plant(3, response, 0.004), {});
  EXPECT_EQ(Quantities(laws), std::set<std::string>{"signal_level"}) << laws[0].law();
  ExpectExponent(laws, "signal_level", 1);
}

TEST(SetupLaw, ConstantAndProportional) {
  const auto law = [](const SetupAmplitude& a) {
    return 0.05 + 0.2 * std::pow(a.camera_distance_m / 0.35, 2);
  };
  const auto laws = FindSetupLaws(Plant(4, law, 0.005), {});
  EXPECT_EQ(Quantities(laws), std::set<std::string>{"camera_distance_m"}) << laws[0].law();
}

TEST(SetupLaw, ProductOfTwo) {
  const auto law = [](const SetupAmplitude& a) {
    return 5e3 * a.exposure_time_s / (a.f_number * a.f_number) *
           std::sqrt(a.camera_distance_m / 0.35) * std::sqrt(a.camera_distance_m / 0.35);
  };
  const auto laws = FindSetupLaws(Plant(5, law, 0.002), {});
  const std::set<std::string> found = Quantities(laws);
  EXPECT_TRUE(found.contains("exposure_time_s")) << laws[0].law();
  EXPECT_TRUE(found.contains("f_number")) << laws[0].law();
  ExpectExponent(laws, "exposure_time_s", 1);
  ExpectExponent(laws, "f_number", -2);
  for (size_t k = 1; k < found.size(); ++k) EXPECT_LE(laws[k].explained(), laws[k - 1].explained());
}

TEST(SetupLaw, CoursesOfTime) {
  const auto warming = [](const SetupAmplitude& a) { return 0.1 * std::exp(-a.timestamp_s / 300); };
  auto laws = FindSetupLaws(Plant(6, warming, 0.002), {});
  EXPECT_EQ(Quantities(laws), std::set<std::string>{"timestamp_s"});
  EXPECT_NE(laws[0].law().find("decays"), std::string::npos) << laws[0].law();

  const auto step = [](const SetupAmplitude& a) { return a.timestamp_s > 900 ? 0.03 : 0.01; };
  laws = FindSetupLaws(Plant(7, step, 0.002), {});
  EXPECT_EQ(Quantities(laws), std::set<std::string>{"timestamp_s"});
  EXPECT_NE(laws[0].law().find("step"), std::string::npos) << laws[0].law();

  const auto drift = [](const SetupAmplitude& a) { return 0.02 - 3e-5 * a.timestamp_s; };
  laws = FindSetupLaws(Plant(8, drift, 0.003), {});
  EXPECT_EQ(Quantities(laws), std::set<std::string>{"timestamp_s"});
  EXPECT_NE(laws[0].law().find("timestamp_s^1"), std::string::npos) << laws[0].law();
}

TEST(SetupLaw, OutliersAndStandardErrorsThatAreTooSmall) {
  const auto law = [](const SetupAmplitude& a) { return 0.3 * std::pow(a.f_number, -1); };
  std::vector<SetupAmplitude> all = Plant(9, law, 0.006);
  all[3].amplitude += 60 * all[3].standard_error;
  all[20].amplitude -= 100 * all[20].standard_error;
  all[31].amplitude += 25 * all[31].standard_error;
  for (SetupAmplitude& a : all) a.standard_error /= 5;
  const auto laws = FindSetupLaws(all, {});
  EXPECT_EQ(Quantities(laws), std::set<std::string>{"f_number"}) << laws[0].law();
  ExpectExponent(laws, "f_number", -1);
}

// A constant however large, normal noise or noise with heavy tails: false laws in about 1 % of the
// cases. More than 5 in 100 would happen by chance with probability 0.0005.
TEST(SetupLaw, NoiseHasNone) {
  int found = 0;
  for (uint64_t k = 0; k < 100; ++k) {
    std::vector<SetupAmplitude> all = Plant(
        100 + k, [k](const SetupAmplitude&) { return k % 3 == 0 ? 0.0 : 0.2; }, 0.01);
    if (k % 2 == 1) {
      CounterRandom random(k, 79);
      for (SetupAmplitude& a : all) {
        // Student's distribution of three degrees of freedom.
        const double x = random.Normal(), y = random.Normal(), z = random.Normal();
        a.amplitude +=
            3 * a.standard_error * random.Normal() / std::sqrt((x * x + y * y + z * z) / 3);
      }
    }
    const auto laws = FindSetupLaws(all, {.significance = 0.01, .seed = k});
    ASSERT_FALSE(laws.empty());
    if (laws[0].quantity() != "none") ++found;
  }
  EXPECT_LE(found, 5);
}

TEST(SetupLaw, SameSeedSameAnswerAndFewAmplitudes) {
  const auto law = [](const SetupAmplitude& a) { return a.defocus_px * 0.01; };
  const std::vector<SetupAmplitude> all = Plant(10, law, 0.01);
  const auto a = FindSetupLaws(all, {}), b = FindSetupLaws(all, {});
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].SerializeAsString(), b[i].SerializeAsString());
  }
  EXPECT_EQ(Quantities(a), std::set<std::string>{"defocus_px"}) << a[0].law();
  const auto few = FindSetupLaws(std::span(all).first(4), {});
  ASSERT_EQ(few.size(), 1U);
  EXPECT_EQ(few[0].quantity(), "none");
}

TEST(SetupLaw, UnknownQuantitiesAreLeftOut) {
  const auto law = [](const SetupAmplitude& a) { return -0.1 * a.signal_level; };
  std::vector<SetupAmplitude> all = Plant(11, law, 0.004);
  for (SetupAmplitude& a : all) a.signal_level = std::numeric_limits<double>::quiet_NaN();
  for (const v1::SetupLaw& found : FindSetupLaws(all, {})) {
    EXPECT_NE(found.quantity(), "signal_level");
  }
}

TEST(SetupLaw, SetupOfAFrame) {
  FrameSetup frame;
  frame.lens.focal_length_m = 0.016;
  frame.lens.f_number = 4;
  frame.lens.focus_distance_m = 0.35;
  frame.plate = {0.25, 0.4, std::numbers::pi / 4, 1e-3};
  frame.sensor.pixel_pitch_m = 5e-6;
  frame.roi = {100, -50, 101, 101};
  frame.burst_frame_index = 3;
  const SetupAmplitude setup = SetupOf(frame);
  EXPECT_EQ(setup.f_number, 4);
  EXPECT_EQ(setup.camera_distance_m, 0.25);
  EXPECT_EQ(setup.burst_frame_index, 3);
  EXPECT_NEAR(setup.field_position_m, 150 * 5e-6, 1e-12);
  // By similar triangles behind the lens: D |b - b'| / b'.
  const double b = 1 / (1 / 0.016 - 1 / 0.35), sharp = 1 / (1 / 0.016 - 1 / 0.25);
  EXPECT_NEAR(setup.defocus_px, 4e-3 * std::abs(b - sharp) / sharp / 5e-6, 1e-9);
  EXPECT_NEAR(setup.row, 1e-3 * b / 0.25 / 5e-6, 1e-9);
}

}  // namespace
}  // namespace sightline
