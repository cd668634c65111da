// SPDX-License-Identifier: Apache-2.0
#include "report/plan/surface/display_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <utility>

namespace sightline {
namespace {

constexpr double kMeshSpacing_m = 0.005;

// Closed box with two triangles per face.
TriangleMesh Box(const Eigen::Vector3f& size_m) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.positions_m.push_back(
        Eigen::Vector3f(i & 1, (i >> 1) & 1, (i >> 2) & 1).cwiseProduct(size_m));
  }
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

double TotalArea(const TriangleMesh& mesh) {
  double area = 0;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) area += mesh.Area(t);
  return area;
}

// Each directed edge once, and its reverse once.
bool IsWatertight(const TriangleMesh& mesh) {
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (const auto& t : mesh.triangles) {
    for (int c = 0; c < 3; ++c) ++edges[{t[c], t[(c + 1) % 3]}];
  }
  for (const auto& [edge, count] : edges) {
    const auto reverse = edges.find({edge.second, edge.first});
    if (count != 1 || reverse == edges.end() || reverse->second != 1) return false;
  }
  return true;
}

TargetSet OnePerFace(const Eigen::Vector3f& size_m) {
  TargetSet targets;
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      Eigen::Vector3f position = 0.5f * size_m;
      position[axis] = side * size_m[axis];
      targets.positions_m.push_back(position);
      targets.normals.push_back((side ? 1.0f : -1.0f) * Eigen::Vector3f::Unit(axis));
    }
  }
  return targets;
}

TEST(SubdivideLongEdges, KeepsAreaAndGaplessnessAndBoundsEdges) {
  const TriangleMesh box = Box({0.45f, 0.02f, 0.1f});
  ASSERT_TRUE(IsWatertight(box));
  const TriangleMesh fine = SubdivideLongEdges(box, kMeshSpacing_m);
  EXPECT_TRUE(IsWatertight(fine));
  EXPECT_NEAR(TotalArea(fine), TotalArea(box), 1e-6 * TotalArea(box));
  EXPECT_GT(fine.triangles.size(), 1000u);
  for (const auto& t : fine.triangles) {
    for (int c = 0; c < 3; ++c) {
      ASSERT_LE((fine.positions_m[t[c]] - fine.positions_m[t[(c + 1) % 3]]).norm(),
                kMeshSpacing_m * 1.0001);
    }
  }
  for (size_t v = 0; v < box.positions_m.size(); ++v)
    EXPECT_EQ(fine.positions_m[v], box.positions_m[v]);
}

TEST(SubdivideLongEdges, LeavesFineMeshAlone) {
  const TriangleMesh box = Box({0.004f, 0.004f, 0.004f});
  EXPECT_EQ(SubdivideLongEdges(box, 0.01).triangles, box.triangles);
}

TEST(MakeDisplayMesh, BoxKeepsSharpEdgesAndFaceNormals) {
  const Eigen::Vector3f size(0.04f, 0.03f, 0.02f);
  const DisplayMesh display = MakeDisplayMesh(Box(size), OnePerFace(size), kMeshSpacing_m, 100000);
  EXPECT_EQ(display.feature_edges_m.size(), 12u);
  EXPECT_FALSE(display.simplified);
  for (const auto& t : display.triangles) {
    const Eigen::Vector3f a = display.positions_m[t[0]], b = display.positions_m[t[1]],
                          c = display.positions_m[t[2]];
    const Eigen::Vector3f face = (b - a).cross(c - a).normalized();
    for (const uint32_t v : t) ASSERT_NEAR(display.normals[v].dot(face), 1, 1e-5);
  }
}

// Also on a wall thinner than the spacing, where the nearest target in space is on the other side.
TEST(MakeDisplayMesh, NearestTargetIsOnTheSameSideOfThinWall) {
  const Eigen::Vector3f size(0.04f, 0.03f, 0.001f);
  TargetSet targets;
  for (int i = 0; i < 8; ++i) {
    for (int j = 0; j < 6; ++j) {
      for (const int side : {0, 1}) {
        // The two sides' targets are staggered: a vertex often has the other side's target nearest.
        const float shift = side ? 0.0025f : 0;
        targets.positions_m.push_back({0.005f * i + shift, 0.005f * j + shift, 0.001f * side});
        targets.normals.push_back({0, 0, side ? 1.0f : -1.0f});
      }
    }
  }
  const DisplayMesh display = MakeDisplayMesh(Box(size), targets, kMeshSpacing_m, 100000);
  ASSERT_EQ(display.nearest_target.size(), display.positions_m.size());
  int checked = 0;
  for (size_t v = 0; v < display.positions_m.size(); ++v) {
    if (std::abs(display.normals[v].z()) < 0.9f) continue;
    EXPECT_GT(display.normals[v].dot(targets.normals[display.nearest_target[v]]), 0.9f);
    ++checked;
  }
  EXPECT_GT(checked, 50);
}

TEST(MakeDisplayMesh, StaysInsideItsBudget) {
  const Eigen::Vector3f size(0.45f, 0.28f, 0.1f);
  const DisplayMesh coarse = MakeDisplayMesh(Box(size), OnePerFace(size), kMeshSpacing_m, 2000);
  EXPECT_LE(coarse.triangles.size(), 2000u);
  EXPECT_GT(coarse.triangles.size(), 300u);
  EXPECT_FALSE(coarse.simplified);

  // 48 k triangles into 5 k.
  const TriangleMesh dense = SubdivideLongEdges(Box(size), 0.006);
  ASSERT_GT(dense.triangles.size(), 20000u);
  const DisplayMesh simplified = MakeDisplayMesh(dense, OnePerFace(size), kMeshSpacing_m, 5000);
  EXPECT_TRUE(simplified.simplified);
  EXPECT_LE(simplified.triangles.size(), 5000u);
  EXPECT_GT(simplified.triangles.size(), 1000u);
}

}  // namespace
}  // namespace sightline
