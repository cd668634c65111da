// SPDX-License-Identifier: Apache-2.0
#include "core/resting/mesh_overlap.h"

#include <gtest/gtest.h>

#include "tests/core/part/test_meshes.h"

namespace sightline {
namespace {

TEST(MeshOverlap, OfBoxesIsTheirIntersection) {
  const TriangleMesh a = BoxMesh({0, 0, 0}, {0.1f, 0.1f, 0.1f});
  const TriangleMesh b = BoxMesh({0.07f, 0.05f, -0.1f}, {0.3f, 0.2f, 0.02f});
  const MeshOverlap overlap = OverlapOf(a, Eigen::Isometry3d::Identity(), b);
  EXPECT_NEAR(overlap.volume_m3, 0.03 * 0.05 * 0.02, 1e-9);
  EXPECT_NEAR(overlap.extent_m[0], 0.03, 1e-6);
  EXPECT_NEAR(overlap.extent_m[1], 0.05, 1e-6);
  EXPECT_NEAR(overlap.extent_m[2], 0.02, 1e-6);
  EXPECT_NEAR(overlap.depth_m(), 0.02, 1e-6);
}

TEST(MeshOverlap, ContactIsNone) {
  const TriangleMesh a = BoxMesh({0, 0, 0}, {0.1f, 0.1f, 0.1f});
  const TriangleMesh table = BoxMesh({-1, -1, -0.02f}, {1, 1, 0});
  EXPECT_EQ(OverlapOf(a, Eigen::Isometry3d::Identity(), table).depth_m(), 0);
  EXPECT_EQ(OverlapOf(a, Eigen::Isometry3d(Eigen::Translation3d(5, 0, 0)), table).volume_m3, 0);
}

TEST(MeshOverlap, IsOfTheMovedBody) {
  const TriangleMesh a = BoxMesh({-0.05f, -0.05f, -0.05f}, {0.05f, 0.05f, 0.05f});
  const TriangleMesh table = BoxMesh({-1, -1, -0.2f}, {1, 1, 0});
  // On its edge, half of the body is below the table's face.
  Eigen::Isometry3d move = Eigen::Isometry3d::Identity();
  move.linear() =
      Eigen::AngleAxisd(0.25 * 3.14159265358979, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const MeshOverlap overlap = OverlapOf(a, move, table);
  EXPECT_NEAR(overlap.volume_m3, 0.5e-3, 5e-6);
}

TEST(MeshOverlap, ABodyTurnedInsideOutCountsToo) {
  const TriangleMesh a = Flipped(BoxMesh({0, 0, 0}, {0.1f, 0.1f, 0.1f}));
  const TriangleMesh b = BoxMesh({0.05f, 0.05f, 0.05f}, {0.2f, 0.2f, 0.2f});
  EXPECT_NEAR(OverlapOf(a, Eigen::Isometry3d::Identity(), b).volume_m3, 1.25e-4, 1e-9);
}

}  // namespace
}  // namespace sightline
