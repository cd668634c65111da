// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/microfacet.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "tests/render_worker/material/material_fixture.h"

namespace sightline {
namespace {

using Eigen::Vector3f;

// Integral over the hemisphere of f(direction) d omega: equal steps of u = cos^power... here the
// substitution cos = 1 - (1 - t)... is left to equal steps in theta and phi, midpoint rule.
template <typename Function>
double HemisphereIntegral(const Function& f, int thetas, int phis) {
  double sum = 0;
  for (int i = 0; i < thetas; ++i) {
    const double theta = 90.0 * (i + 0.5) / thetas;
    double ring = 0;
    for (int j = 0; j < phis; ++j) ring += f(Direction(theta, 360.0 * (j + 0.5) / phis));
    sum += ring * std::sin(theta * std::numbers::pi / 180);
  }
  return sum * (0.5 * std::numbers::pi / thetas) * (2 * std::numbers::pi / phis);
}

TEST(Ggx, ProjectedAreaOfFacetsIsOne) {
  for (const auto& [ax, ay] : {std::pair{0.1F, 0.1F}, {0.4F, 0.4F}, {0.1F, 0.5F}, {1.0F, 1.0F}}) {
    const GgxRoughness roughness{ax, ay};
    const double area = HemisphereIntegral(
        [&](const Vector3f& h) { return GgxDistribution(roughness, h) * h.z(); }, 2000, 200);
    EXPECT_NEAR(area, 1, 1e-4) << ax << " " << ay;
  }
}

// Smith's condition: the visible facets' projected area is that of the surface, for every view.
TEST(Ggx, VisibleFacetsFillTheProjectedSurface) {
  for (const auto& [ax, ay] : {std::pair{0.3F, 0.3F}, {0.15F, 0.5F}}) {
    const GgxRoughness roughness{ax, ay};
    for (const double theta : {0.0, 30.0, 60.0, 80.0}) {
      const Vector3f out = Direction(theta, 25);
      const double area = HemisphereIntegral(
          [&](const Vector3f& h) {
            return GgxMasking(roughness, out) * std::max(0.0F, out.dot(h)) *
                   GgxDistribution(roughness, h);
          },
          1000, 400);
      EXPECT_NEAR(area / out.z(), 1, 1e-3) << theta;
    }
  }
}

// The recordings format's G and D for the view along the normal.
TEST(Ggx, MaskingOfTheNormalIsOne) {
  const GgxRoughness roughness{0.4F, 0.4F};
  EXPECT_EQ(GgxMasking(roughness, Vector3f::UnitZ()), 1);
  for (const double theta : {10.0, 45.0, 75.0}) {
    const double tangent = std::tan(theta * std::numbers::pi / 180);
    const double expected = 2 / (1 + std::sqrt(1 + 0.16 * tangent * tangent));
    EXPECT_NEAR(GgxMaskingShadowing(roughness, Vector3f::UnitZ(), Direction(theta, 0)), expected,
                1e-6);
  }
}

}  // namespace
}  // namespace sightline
