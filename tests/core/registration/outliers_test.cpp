// SPDX-License-Identifier: Apache-2.0
#include "core/registration/outliers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/random/counter_random.h"
#include "core/rig/rig.h"

namespace sightline {
namespace {

// A plane z = 0 that a scan has measured every 0.2 mm with noise.
PointsOnModel PointsOfPlane(double noise_m, uint64_t seed) {
  CounterRandom random(seed, 0);
  PointsOnModel points;
  for (int i = -50; i < 50; ++i) {
    for (int j = -50; j < 50; ++j) {
      points.positions_m.emplace_back(2e-4f * static_cast<float>(i), 2e-4f * static_cast<float>(j),
                                      0.0f);
      points.normals.emplace_back(0.0f, 0.0f, 1.0f);
      points.deviations_m.push_back(static_cast<float>(noise_m * random.Normal()));
      points.distances_m.push_back(std::abs(points.deviations_m.back()));
      points.sure.push_back(1);
    }
  }
  return points;
}

ScanNoise SomeNoise() {
  Measurement scan;
  scan.camera_distance_m = 0.3;
  scan.triangulation_angle_rad = 0.5;
  return ScanNoise(Rig{}, scan, Eigen::Vector3d::Zero(), UncertaintyModel{});
}

TEST(Outliers, PointsFarFromTheirNeighboursAreFoundAndOthersKept) {
  PointsOnModel points = PointsOfPlane(1e-5, 1);
  std::vector<size_t> false_points;
  for (size_t p = 37; p < points.deviations_m.size(); p += 997) {
    points.deviations_m[p] += 2e-3f;
    false_points.push_back(p);
  }
  const auto outliers = FindOutliers(points, SomeNoise(), {});
  for (const size_t p : false_points) EXPECT_EQ(outliers[p], 1) << p;
  EXPECT_EQ(std::count(outliers.begin(), outliers.end(), 1),
            static_cast<std::ptrdiff_t>(false_points.size()));
  const size_t before = points.positions_m.size();
  EXPECT_EQ(RemovePoints(outliers, points), static_cast<int64_t>(false_points.size()));
  EXPECT_EQ(points.positions_m.size(), before - false_points.size());
  EXPECT_LT(*std::max_element(points.deviations_m.begin(), points.deviations_m.end()), 1e-3f);
}

// A dent of 0.3 mm over 6 mm is the surface.
TEST(Outliers, ADentHasNone) {
  PointsOnModel points = PointsOfPlane(1e-5, 2);
  for (size_t p = 0; p < points.positions_m.size(); ++p) {
    const float r = points.positions_m[p].norm() / 2e-3f;
    points.deviations_m[p] -= 3e-4f * std::exp(-0.5f * r * r);
  }
  const auto outliers = FindOutliers(points, SomeNoise(), {});
  EXPECT_EQ(std::count(outliers.begin(), outliers.end(), 1), 0);
}

TEST(Outliers, RepeatedPointsAreFoundOnce) {
  const std::vector<Eigen::Vector3d> points = {
      {1, 2, 3}, {1, 2, 4}, {1, 2, 3}, {0, 0, 0}, {1, 2, 3}};
  EXPECT_EQ(FindDuplicates(points), (std::vector<uint8_t>{0, 0, 1, 0, 1}));
}

}  // namespace
}  // namespace sightline
