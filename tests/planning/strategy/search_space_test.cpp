// SPDX-License-Identifier: Apache-2.0
#include "planning/optimise/search_space.h"

#include <gtest/gtest.h>

#include <set>

#include "core/random/random.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kDeg = std::numbers::pi / 180;

bool InDomain(const ParameterDomain& domain, double value) {
  for (const auto& range : domain.ranges) {
    if (value >= range.min && value <= range.max) return true;
  }
  for (double allowed : domain.values) {
    if (value == allowed) return true;
  }
  return false;
}

std::vector<double> RandomPoint(Random& random, int dimension, double from, double to) {
  std::vector<double> x(dimension);
  for (double& coordinate : x) coordinate = from + (to - from) * random.Uniform();
  return x;
}

TEST(SearchSpaceTest, RoundTripsRandomPointsOfTheThesisDomain) {
  const MeasurementDomain domain = NineParameterDomain();
  const SearchSpace space(domain);
  ASSERT_EQ(space.dimension(), 9);
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const std::vector<double> x = RandomPoint(random, 9, 0, 1);
    const Measurement m = space.ToMeasurement(x);
    for (int p = 0; p < kMeasurementParameters; ++p) {
      EXPECT_TRUE(InDomain(domain.parameters[p], ToArray(m)[p])) << p;
    }
    const std::vector<double> back = space.ToUnit(m);
    for (int d = 0; d < 9; ++d) EXPECT_NEAR(back[d], x[d], 1e-12);
  }
}

TEST(SearchSpaceTest, UnionOfRangesTakesOneCoordinateInProportionToLength) {
  MeasurementDomain domain = OffsetDomain();
  domain.parameters[7].ranges = {{-0.5, -0.2}, {0.1, 0.2}};
  const SearchSpace space(domain);
  ASSERT_EQ(space.dimension(), 1);
  EXPECT_DOUBLE_EQ(space.ToMeasurement(std::vector{0.0}).offset_y_m, -0.5);
  EXPECT_NEAR(space.ToMeasurement(std::vector{0.375}).offset_y_m, -0.35, 1e-12);
  EXPECT_NEAR(space.ToMeasurement(std::vector{0.7499}).offset_y_m, -0.2, 1e-4);
  EXPECT_NEAR(space.ToMeasurement(std::vector{0.7501}).offset_y_m, 0.1, 1e-4);
  EXPECT_DOUBLE_EQ(space.ToMeasurement(std::vector{1.0}).offset_y_m, 0.2);
  // The gap belongs to the nearer range.
  Measurement m;
  m.offset_y_m = -0.15;
  EXPECT_NEAR(space.ToUnit(m)[0], 0.75, 1e-12);
  m.offset_y_m = 0.05;
  EXPECT_NEAR(space.ToMeasurement(space.ToUnit(m)).offset_y_m, 0.1, 0.3 + 1e-9);
  m.offset_y_m = 0.15;
  EXPECT_NEAR(space.ToMeasurement(space.ToUnit(m)).offset_y_m, 0.15, 1e-12);
}

TEST(SearchSpaceTest, FullTurnsWrapAndOtherCoordinatesAreClipped) {
  const SearchSpace space(NineParameterDomain());
  EXPECT_EQ(space.periodic(),
            (std::vector<bool>{false, false, true, false, true, true, true, false, false}));
  std::vector<double> x(9, 0.5);
  x[2] = 1.25;
  x[0] = 1.25;
  x[4] = -0.25;
  x[5] = -1e-20;
  const Measurement m = space.ToMeasurement(x);
  EXPECT_NEAR(m.camera_azimuth_rad, 0.25 * kTurn, 1e-12);
  EXPECT_DOUBLE_EQ(m.camera_distance_m, 0.8);
  EXPECT_NEAR(m.part_alpha_rad, 0.75 * kTurn, 1e-12);
  EXPECT_LT(m.part_beta_rad, kTurn);
  // 370 degrees is 10 degrees.
  Measurement turned = m;
  turned.camera_azimuth_rad = 370 * kDeg;
  EXPECT_NEAR(space.ToUnit(turned)[2], 10.0 / 360, 1e-12);
}

TEST(SearchSpaceTest, PartialTurnOfAnAngleIsClipped) {
  MeasurementDomain domain = OffsetDomain();
  domain.parameters[7] = {{}, {0.0}, false};
  domain.parameters[2] = {{{10 * kDeg, 100 * kDeg}}, {}, true};
  const SearchSpace space(domain);
  EXPECT_EQ(space.periodic(), std::vector<bool>{false});
  EXPECT_DOUBLE_EQ(space.ToMeasurement(std::vector{1.3}).camera_azimuth_rad, 100 * kDeg);
  Measurement m;
  m.camera_azimuth_rad = -280 * kDeg;  // the same as 80 degrees
  EXPECT_NEAR(space.ToUnit(m)[0], 70.0 / 90, 1e-12);
}

TEST(SearchSpaceTest, ValueListsTakeEqualCellsAndFixedParametersNone) {
  MeasurementDomain domain = OffsetDomain();
  domain.parameters[0].values = {0.3, 0.4, 0.7};
  const SearchSpace space(domain);
  ASSERT_EQ(space.dimension(), 2);
  Random random(2);
  std::array<int, 3> hits{};
  for (int i = 0; i < 3000; ++i) {
    const Measurement m = space.ToMeasurement(RandomPoint(random, 2, 0, 1));
    hits[m.camera_distance_m == 0.3 ? 0 : m.camera_distance_m == 0.4 ? 1 : 2] += 1;
    EXPECT_EQ(m.triangulation_angle_rad, Measurement{}.triangulation_angle_rad);
    EXPECT_EQ(space.ToMeasurement(space.ToUnit(m)).camera_distance_m, m.camera_distance_m);
  }
  // Binomial, standard deviation 26.
  for (int count : hits) EXPECT_NEAR(count, 1000, 110);
  EXPECT_EQ(space.ToMeasurement(std::vector{1.0, 0.0}).camera_distance_m, 0.7);
}

TEST(SearchSpaceTest, RestingOrientationsReplaceAlphaAndBeta) {
  MeasurementDomain domain = NineParameterDomain();
  domain.resting_orientations = {{0, 0}, {std::numbers::pi, 0}, {0.5, 1.5}};
  const SearchSpace space(domain);
  ASSERT_EQ(space.dimension(), 8);
  Random random(3);
  std::set<std::pair<double, double>> seen;
  for (int i = 0; i < 200; ++i) {
    const Measurement m = space.ToMeasurement(RandomPoint(random, 8, -0.5, 1.5));
    seen.insert({m.part_alpha_rad, m.part_beta_rad});
    const Measurement back = space.ToMeasurement(space.ToUnit(m));
    EXPECT_EQ(back.part_alpha_rad, m.part_alpha_rad);
    EXPECT_EQ(back.part_beta_rad, m.part_beta_rad);
  }
  EXPECT_EQ(seen, (std::set<std::pair<double, double>>{{0, 0}, {std::numbers::pi, 0}, {0.5, 1.5}}));
}

TEST(SearchSpaceTest, EverythingFixedHasNoDimension) {
  MeasurementDomain domain = OffsetDomain();
  domain.parameters[7] = {{{0.25, 0.25}}, {}, false};
  domain.resting_orientations = {{0.1, 0.2}};
  const SearchSpace space(domain);
  EXPECT_EQ(space.dimension(), 0);
  const Measurement m = space.ToMeasurement({});
  EXPECT_EQ(m.offset_y_m, 0.25);
  EXPECT_EQ(m.part_alpha_rad, 0.1);
  EXPECT_EQ(m.part_beta_rad, 0.2);
}

}  // namespace
}  // namespace sightline
