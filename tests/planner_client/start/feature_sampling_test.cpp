// SPDX-License-Identifier: Apache-2.0
#include "planner_client/inspection_draft/feature_sampling.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/inspection/inspection.h"
#include "core/targets/poisson_disk.h"
#include "core/targets/target_regions.h"

namespace sightline {
namespace {

// A square face in the plane z = 0 with a corner at `x_m`, y = 0.
FaceTriangles Square(int number, double x_m, double side_m) {
  FaceTriangles face;
  face.face = number;
  face.positions_m = {
      {x_m, 0, 0}, {x_m + side_m, 0, 0}, {x_m + side_m, side_m, 0}, {x_m, side_m, 0}};
  face.triangles = {{0, 1, 2}, {0, 2, 3}};
  return face;
}

ToleranceReport Report() {
  ToleranceReport report;
  Tolerance flatness;
  flatness.name = "flatness.1";
  flatness.faces = {1, 2};
  report.read = {flatness};
  Datum datum;
  datum.letter = "A";
  datum.faces = {2, 3};
  report.datums = {datum};
  return report;
}

TEST(FeatureSampling, EverySurfaceOfTolerancesAndDatumsHasEnoughTargets) {
  const std::vector<FaceTriangles> faces = {Square(1, 0, 0.1), Square(2, 0.2, 0.01),
                                            Square(3, 0.3, 0.006), Square(4, 0.4, 0.004)};
  const std::vector<TolerancedSurface> surfaces = TolerancedSurfacesOf(Report(), faces);
  ASSERT_EQ(surfaces.size(), 3u);
  EXPECT_NEAR(surfaces[1].area_m2, 1e-4, 1e-12);
  EXPECT_EQ(surfaces[1].name, "face 2: flatness.1");
  EXPECT_EQ(surfaces[2].name, "face 3: datum A");

  v1::TargetSampling message;
  message.set_spacing_m(0.005);
  for (const v1::TargetRegion& region : SampleFeatures(surfaces, 0.005)) {
    *message.add_regions() = region;
  }
  ASSERT_EQ(message.regions_size(), 2) << "the large face has enough";
  const auto sampling = ParseTargetSampling(message, "test");
  ASSERT_TRUE(sampling.ok()) << sampling.status();
  TriangleMesh mesh;
  for (const FaceTriangles& face : faces) {
    const auto first = static_cast<uint32_t>(mesh.positions_m.size());
    for (const Eigen::Vector3d& p : face.positions_m) mesh.positions_m.push_back(p.cast<float>());
    for (const auto& t : face.triangles) {
      mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    }
  }
  const auto targets = SampleTargets(mesh, *sampling);
  ASSERT_TRUE(targets.ok()) << targets.status();
  for (const TolerancedSurface& surface : surfaces) {
    const auto on = std::count_if(targets->positions_m.begin(), targets->positions_m.end(),
                                  [&](const Eigen::Vector3f& p) {
                                    return surface.box_m.exteriorDistance(p.cast<double>()) < 1e-6;
                                  });
    // The sampling keeps its promise on average; the border of a small face holds more.
    EXPECT_GE(on, kWishedFeatureTargets) << surface.name;
  }
}

TEST(FeatureSampling, TheSmallestSurfacesGetTheRegionsThatThereAre) {
  std::vector<TolerancedSurface> surfaces;
  for (size_t i = 0; i < kMostSampledFeatures + 10; ++i) {
    TolerancedSurface& surface = surfaces.emplace_back();
    surface.name = std::to_string(i);
    surface.area_m2 = 1e-6 * static_cast<double>(kMostSampledFeatures + 10 - i);
    surface.box_m.extend(Eigen::Vector3d::Zero());
  }
  const auto regions = SampleFeatures(surfaces, 0.01);
  ASSERT_EQ(regions.size(), kMostSampledFeatures);
  EXPECT_EQ(regions.front().name(), "10");
}

}  // namespace
}  // namespace sightline
