// SPDX-License-Identifier: Apache-2.0
#include "report/plan/surface/uncovered_regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <random>

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kTargetSpacing_m = 0.005;

TargetSampling Sampling() {
  TargetSampling sampling;
  sampling.spacing_m = kTargetSpacing_m;
  return sampling;
}

void AddTarget(TargetSet* targets, const Eigen::Vector3f& position_m, const Eigen::Vector3f& normal,
               int32_t region = -1) {
  targets->positions_m.push_back(position_m);
  targets->normals.push_back(normal);
  targets->regions.push_back(region);
  targets->triangles.push_back(0);
}

// columns x rows targets on a plane that faces z, lower left corner at `corner_m`.
void AddPatch(TargetSet* targets, const Eigen::Vector3f& corner_m, int columns, int rows,
              const Eigen::Vector3f& normal = Eigen::Vector3f::UnitZ(),
              float spacing_m = kTargetSpacing_m, int32_t region = -1) {
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      AddTarget(targets, corner_m + spacing_m * Eigen::Vector3f(i, j, 0), normal, region);
    }
  }
}

TargetBits All(const TargetSet& targets) {
  TargetBits bits(targets.size());
  for (size_t i = 0; i < targets.size(); ++i) bits.Set(i);
  return bits;
}

TEST(FindUncoveredRegions, NothingSelectedGivesNoRegion) {
  TargetSet targets;
  AddPatch(&targets, {0, 0, 0}, 3, 3);
  EXPECT_TRUE(FindUncoveredRegions(targets, Sampling(), TargetBits(targets.size())).empty());
}

TEST(FindUncoveredRegions, SeparatesPatchesAndSortsThemBySize) {
  TargetSet targets;
  AddPatch(&targets, {0, 0, 0}, 3, 2);
  AddPatch(&targets, {0.1f, 0, 0}, 6, 4);
  AddPatch(&targets, {0, 0.1f, 0}, 1, 1);
  const auto regions = FindUncoveredRegions(targets, Sampling(), All(targets));
  ASSERT_EQ(regions.size(), 3u);
  EXPECT_EQ(regions[0].targets.size(), 24u);
  EXPECT_EQ(regions[1].targets.size(), 6u);
  EXPECT_EQ(regions[2].targets.size(), 1u);
  EXPECT_NEAR(regions[0].centroid_m.x(), 0.1 + 2.5 * kTargetSpacing_m, 1e-6);
  EXPECT_NEAR(regions[0].bounds_m.sizes().x(), 5 * kTargetSpacing_m, 1e-6);
  EXPECT_NEAR(regions[0].bounds_m.sizes().y(), 3 * kTargetSpacing_m, 1e-6);
  EXPECT_NEAR(regions[0].mean_normal.z(), 1, 1e-6);
}

TEST(FindUncoveredRegions, OnlySelectedTargetsConnect) {
  TargetSet targets;
  AddPatch(&targets, {0, 0, 0}, 9, 1);
  TargetBits selected = All(targets);
  // A gap of three targets: neighbours 20 mm apart, twice the link radius.
  for (size_t i = 3; i < 6; ++i) selected.Reset(i);
  const auto regions = FindUncoveredRegions(targets, Sampling(), selected);
  ASSERT_EQ(regions.size(), 2u);
  EXPECT_THAT(regions[0].targets, ElementsAre(0, 1, 2));
  EXPECT_THAT(regions[1].targets, ElementsAre(6, 7, 8));
}

TEST(FindUncoveredRegions, KeepsSidesOfThinWallApartButFollowsEdges) {
  TargetSet wall;
  AddPatch(&wall, {0, 0, 0}, 4, 4, Eigen::Vector3f::UnitZ());
  AddPatch(&wall, {0, 0, -0.003f}, 4, 4, -Eigen::Vector3f::UnitZ());
  EXPECT_EQ(FindUncoveredRegions(wall, Sampling(), All(wall)).size(), 2u);

  TargetSet edge;
  AddPatch(&edge, {0, 0, 0}, 4, 4, Eigen::Vector3f::UnitZ());
  for (int j = 0; j < 4; ++j) {
    AddTarget(&edge, {-0.001f, 0.005f * j, -0.004f}, -Eigen::Vector3f::UnitX());
  }
  EXPECT_EQ(FindUncoveredRegions(edge, Sampling(), All(edge)).size(), 1u);
}

TEST(FindUncoveredRegions, SharesOfAreaAddUpAndCountDenseTargetsForLess) {
  TargetSampling sampling = Sampling();
  sampling.regions.push_back({"seat", {-1, -1, -1}, {1, 1, 1}, kTargetSpacing_m / 2});
  TargetSet targets;
  AddPatch(&targets, {0, 0, 0}, 4, 4);
  AddPatch(&targets, {0.1f, 0, 0}, 8, 8, Eigen::Vector3f::UnitZ(), kTargetSpacing_m / 2, 0);
  const auto regions = FindUncoveredRegions(targets, sampling, All(targets));
  ASSERT_EQ(regions.size(), 2u);
  // 16 targets of 25 mm2 are as much surface as 64 of 6.25 mm2.
  EXPECT_NEAR(regions[0].area_share, 0.5, 1e-12);
  EXPECT_NEAR(regions[1].area_share, 0.5, 1e-12);
}

TEST(FindUncoveredRegions, EveryTargetIsInExactlyOneRegionAndRegionsAreFarApart) {
  std::mt19937 random(7);
  TargetSet targets;
  for (int i = 0; i < 1500; ++i) {
    const auto coordinate = [&] { return 0.15f * static_cast<float>(random()) / 4294967296.0f; };
    const float x = coordinate(), y = coordinate(), z = coordinate();
    AddTarget(&targets, {x, y, z}, Eigen::Vector3f::UnitX());
  }
  const auto regions = FindUncoveredRegions(targets, Sampling(), All(targets));
  ASSERT_GT(regions.size(), 3u);
  std::vector<int> region_of(targets.size(), -1);
  for (size_t r = 0; r < regions.size(); ++r) {
    for (const uint32_t target : regions[r].targets) {
      EXPECT_EQ(region_of[target], -1);
      region_of[target] = static_cast<int>(r);
    }
  }
  // Brute force: linked pairs share a region. That regions are not larger than need be follows from
  // the tests above.
  int pairs = 0;
  for (size_t i = 0; i < targets.size(); ++i) {
    ASSERT_GE(region_of[i], 0);
    for (size_t j = 0; j < i; ++j) {
      if ((targets.positions_m[i] - targets.positions_m[j]).norm() > 2 * kTargetSpacing_m * 0.9999)
        continue;
      EXPECT_EQ(region_of[i], region_of[j]);
      ++pairs;
    }
  }
  EXPECT_GT(pairs, 100);
}

TEST(DescribePlace, NamesNearestFaceDepthAndDirection) {
  const Eigen::AlignedBox3d part(Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.45, 0.28, 0.1));
  UncoveredRegion region;
  region.centroid_m = {0.1, 0.001, 0.077};
  region.mean_normal = {0, -1, 0};
  EXPECT_EQ(DescribePlace(region, part),
            "at the y\u2212 side, 23 mm below the top, 100 mm from x\u2212, facing y\u2212");

  region.centroid_m = {0.4, 0.2, 0.03};
  region.mean_normal = {0.1, 0, 0.1};
  EXPECT_EQ(DescribePlace(region, part),
            "30 mm inside the bottom (z\u2212), 80 mm from y+, 50 mm from x+, facing all round");

  region.mean_normal = {0.7, 0, 0.7};
  EXPECT_THAT(DescribePlace(region, part), HasSubstr("facing x+ and z+"));
}

}  // namespace
}  // namespace sightline
