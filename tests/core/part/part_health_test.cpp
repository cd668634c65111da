// SPDX-License-Identifier: Apache-2.0
#include "core/part/part_health.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/core/part/test_meshes.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const TriangleMesh kOuter = BoxMesh({0, 0, 0}, {1, 1, 1});
const TriangleMesh kInner = BoxMesh({0.4f, 0.4f, 0.4f}, {0.6f, 0.6f, 0.6f});

TEST(PartHealth, SoundPartHasNoFindings) {
  const PartHealth health = CheckPartHealth(SphereMesh(0.1, 3));
  EXPECT_EQ(health.triangle_count, 20 * 64);
  EXPECT_EQ(health.vertex_count, 10 * 64 + 2);  // Euler: V = T / 2 + 2
  EXPECT_NEAR(health.area_m2, 4 * std::numbers::pi * 0.01, 0.01 * 4 * std::numbers::pi * 0.01);
  EXPECT_NEAR(health.bounding_box_m.sizes().x(), 0.2, 1e-3);
  EXPECT_EQ(health.open_edge_count, 0);
  EXPECT_EQ(health.non_manifold_edge_count, 0);
  EXPECT_EQ(health.degenerate_triangle_count, 0);
  EXPECT_EQ(health.duplicate_triangle_count, 0);
  EXPECT_EQ(health.component_count, 1);
  EXPECT_EQ(health.flipped_component_count, 0);
  EXPECT_THAT(health.findings, IsEmpty());
}

TEST(PartHealth, EmptyMesh) {
  const PartHealth health = CheckPartHealth(TriangleMesh());
  EXPECT_EQ(health.triangle_count, 0);
  EXPECT_THAT(health.findings, ElementsAre(HasSubstr("no triangles")));
}

TEST(PartHealth, MissingTriangleLeavesThreeOpenEdges) {
  TriangleMesh mesh = kOuter;
  mesh.triangles.pop_back();
  const PartHealth health = CheckPartHealth(mesh);
  EXPECT_EQ(health.open_edge_count, 3);
  EXPECT_EQ(health.component_count, 1);
  EXPECT_THAT(health.findings, ElementsAre(HasSubstr("holes")));
  EXPECT_THAT(health.findings[0], HasSubstr("3414 mm of rim"));  // 1 + 1 + sqrt 2 m
}

TEST(PartHealth, OpenSheetHasItsRim) {
  EXPECT_EQ(CheckPartHealth(PlateMesh(1, 1, 4, 3)).open_edge_count, 2 * (4 + 3));
}

TEST(PartHealth, InsideOutPartIsFlipped) {
  const PartHealth health = CheckPartHealth(Flipped(kOuter));
  EXPECT_EQ(health.flipped_component_count, 1);
  EXPECT_THAT(health.findings, ElementsAre(HasSubstr("inside out")));
}

TEST(PartHealth, VoidInsideMaterialPointsIntoTheVoid) {
  const PartHealth sound = CheckPartHealth(Merged(kOuter, Flipped(kInner)));
  EXPECT_EQ(sound.component_count, 2);
  EXPECT_EQ(sound.flipped_component_count, 0);
  EXPECT_THAT(sound.findings, ElementsAre(HasSubstr("inside another one")));
  // The void's surface pointing outwards is the fault here.
  EXPECT_EQ(CheckPartHealth(Merged(kOuter, kInner)).flipped_component_count, 1);
  // A loose part in the void is sound again.
  const TriangleMesh loose = BoxMesh({0.45f, 0.45f, 0.45f}, {0.55f, 0.55f, 0.55f});
  EXPECT_EQ(CheckPartHealth(Merged(Merged(kOuter, Flipped(kInner)), loose)).flipped_component_count,
            0);
}

TEST(PartHealth, NestingIsFoundWhereTheBoxesAloneWouldMislead) {
  // A box in the hollow of an L: inside the L's bounding box, outside the L.
  TriangleMesh l;
  l.positions_m = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0},
                   {0, 0, 1}, {2, 0, 1}, {2, 1, 1}, {1, 1, 1}, {1, 2, 1}, {0, 2, 1}};
  for (uint32_t i = 0; i < 6; ++i) {
    const uint32_t j = (i + 1) % 6;
    l.triangles.push_back({i, j, j + 6});
    l.triangles.push_back({i, j + 6, i + 6});
  }
  for (const auto& [a, b, c] :
       std::vector<std::array<uint32_t, 3>>{{0, 1, 3}, {1, 2, 3}, {0, 3, 5}, {3, 4, 5}}) {
    l.triangles.push_back({a, c, b});
    l.triangles.push_back({a + 6, b + 6, c + 6});
  }
  ASSERT_THAT(CheckPartHealth(l).findings, IsEmpty());
  const TriangleMesh beside = BoxMesh({1.2f, 1.2f, 0.2f}, {1.8f, 1.8f, 0.8f});
  const PartHealth health = CheckPartHealth(Merged(l, beside));
  EXPECT_EQ(health.flipped_component_count, 0);
  EXPECT_THAT(health.findings, IsEmpty());
  const TriangleMesh within = BoxMesh({1.2f, 0.2f, 0.2f}, {1.8f, 0.8f, 0.8f});
  EXPECT_EQ(CheckPartHealth(Merged(l, within)).flipped_component_count, 1);
}

TEST(PartHealth, OneTurnedTriangleIsReported) {
  TriangleMesh mesh = kOuter;
  std::swap(mesh.triangles[0][1], mesh.triangles[0][2]);
  const PartHealth health = CheckPartHealth(mesh);
  EXPECT_EQ(health.open_edge_count, 0);
  EXPECT_EQ(health.flipped_component_count, 0);
  EXPECT_THAT(health.findings, ElementsAre(HasSubstr("disagree which side is outside along 3")));
}

TEST(PartHealth, DegenerateAndDuplicateTrianglesAreCounted) {
  TriangleMesh mesh = kOuter;
  mesh.triangles.push_back({0, 0, 1});
  mesh.triangles.push_back({mesh.triangles[3][2], mesh.triangles[3][0], mesh.triangles[3][1]});
  // Three points on a line.
  const uint32_t base = static_cast<uint32_t>(mesh.positions_m.size());
  for (float x : {5.0f, 6.0f, 7.0f}) mesh.positions_m.emplace_back(x, 0.0f, 0.0f);
  mesh.triangles.push_back({base, base + 1, base + 2});
  const PartHealth health = CheckPartHealth(mesh);
  EXPECT_EQ(health.degenerate_triangle_count, 2);
  EXPECT_EQ(health.duplicate_triangle_count, 1);
  EXPECT_EQ(health.non_manifold_edge_count, 3);
}

TEST(PartHealth, ASheetWithTwoSidesIsNoInnerWall) {
  TriangleMesh sheet = PlateMesh(0.2, 0.1, 4, 2);
  for (const auto& t : TriangleMesh(sheet).triangles) sheet.triangles.push_back({t[0], t[2], t[1]});
  const PartHealth health = CheckPartHealth(sheet);
  EXPECT_EQ(health.duplicate_triangle_count, 16);
  EXPECT_GT(health.non_manifold_edge_count, 0);
  EXPECT_THAT(health.findings, ElementsAre(HasSubstr("a sheet without thickness with two sides")));
}

TEST(PartHealth, TrianglesWithoutAreaAreNoDuplicates) {
  TriangleMesh mesh = kOuter;
  for (int i = 0; i < 2; ++i) mesh.triangles.push_back({0, 1, 1});
  const PartHealth health = CheckPartHealth(mesh);
  EXPECT_EQ(health.degenerate_triangle_count, 2);
  EXPECT_EQ(health.duplicate_triangle_count, 0);
}

TEST(PartHealth, BodiesThatShareAnEdgeAreNonManifold) {
  TriangleMesh mesh = Merged(BoxMesh({0, 0, 0}, {1, 1, 1}), BoxMesh({1, 1, 0}, {2, 2, 1}));
  // Weld the common edge (1, 1, 0..1): corners 3 and 7 of the first, 0 and 4 of the second.
  for (auto& t : mesh.triangles) {
    for (uint32_t& index : t) index = index == 8 ? 3 : index == 12 ? 7 : index;
  }
  const PartHealth health = CheckPartHealth(mesh);
  EXPECT_EQ(health.non_manifold_edge_count, 1);
  EXPECT_EQ(health.open_edge_count, 0);
  EXPECT_EQ(health.component_count, 1);
}

}  // namespace
}  // namespace sightline
