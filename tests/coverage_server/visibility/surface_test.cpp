// SPDX-License-Identifier: Apache-2.0
// Small building blocks: probes, direction grid, target look-up.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "core/targets/poisson_disk.h"
#include "coverage_server/scan/target_lookup.h"
#include "coverage_server/visibility/octahedral_map.h"
#include "coverage_server/visibility/surface_probes.h"
#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

// Distance of a point to a triangle: to its plane inside, to its edges outside.
double DistanceToTriangle(const Eigen::Vector3d& p, const Eigen::Vector3d* v) {
  const Eigen::Vector3d n = (v[1] - v[0]).cross(v[2] - v[0]).normalized();
  bool inside = true;
  double edge = 1e9;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d a = v[k], b = v[(k + 1) % 3];
    inside &= n.dot((b - a).cross(p - a)) >= 0;
    const double t = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
    edge = std::min(edge, (p - a - t * (b - a)).norm());
  }
  return inside ? std::abs(n.dot(p - v[0])) : edge;
}

TEST(SurfaceProbes, LieOnTheSurfaceWithinTheRadius) {
  const TriangleMesh part = BlindHolePart();
  TargetSampling sampling;
  auto targets = SampleTargets(part, sampling);
  ASSERT_TRUE(targets.ok());
  const SurfaceProbes probes = MakeSurfaceProbes(part, TriangleBvh(part), *targets, sampling);
  ASSERT_EQ(probes.positions_m.size(), targets->size() * kProbesPerTarget);
  ASSERT_EQ(probes.normals.size(), probes.positions_m.size());
  size_t distinct = 0;
  for (size_t t = 0; t < targets->size(); ++t) {
    EXPECT_EQ(probes.positions_m[t * kProbesPerTarget], targets->positions_m[t]);
    for (int k = 0; k < kProbesPerTarget; ++k) {
      const size_t slot = t * kProbesPerTarget + k;
      const Eigen::Vector3d p = probes.positions_m[slot].cast<double>();
      EXPECT_LE((p - targets->positions_m[t].cast<double>()).norm(),
                sampling.coverage_radius_m + 1e-7);
      EXPECT_GE(probes.normals[slot].dot(targets->normals[t]),
                std::cos(sampling.max_normal_angle_rad) - 1e-5);
      distinct += k > 0 && probes.positions_m[slot] != targets->positions_m[t];
      if (t % 8 != 0) continue;
      double distance = 1e9;
      for (size_t i = 0; i < part.triangles.size(); ++i) {
        const Eigen::Vector3d v[3] = {part.Corner(i, 0), part.Corner(i, 1), part.Corner(i, 2)};
        if (part.Normal(i).dot(probes.normals[slot].cast<double>()) < 0.999) continue;
        distance = std::min(distance, DistanceToTriangle(p, v));
      }
      EXPECT_LT(distance, 1e-6);
    }
  }
  // Nearly every probe has found its own place.
  EXPECT_GT(distinct, targets->size() * (kProbesPerTarget - 1) * 9 / 10);
}

TEST(OctahedralMap, CellsAndDirectionsBelongTogether) {
  for (const int side : {8, 16, 64}) {
    const OctahedralMap map{side};
    std::set<std::array<float, 3>> all;
    for (int cell = 0; cell < map.cells(); ++cell) {
      const Eigen::Vector3f d = map.Direction(cell);
      EXPECT_NEAR(d.norm(), 1, 1e-6);
      EXPECT_EQ(map.Cell(d), cell);
      EXPECT_EQ(map.Cell(0.01f * d), cell);
      all.insert({d.x(), d.y(), d.z()});
    }
    EXPECT_EQ(all.size(), static_cast<size_t>(map.cells()));
    // A cell is 2 / side wide on the octahedron, whose faces are 1/sqrt(3) from the centre: the
    // projection magnifies at most sqrt(3)-fold, so the centre is at most sqrt(3) * half the
    // longest diagonal (2 / side * sqrt(6) / 2 in space) away.
    const double bound = std::sqrt(3.0) * std::sqrt(6.0) / side;
    Random random(51);
    double worst = 0, mean_z = 0;
    for (int i = 0; i < 20000; ++i) {
      const Eigen::Vector3f d = random.Direction().cast<float>();
      const Eigen::Vector3f near = map.Direction(map.Cell(d));
      worst = std::max<double>(worst, std::acos(std::clamp(d.dot(near), -1.0f, 1.0f)));
      mean_z += near.z();
    }
    EXPECT_LT(worst, bound) << side;
    EXPECT_GT(worst, 1.0 / side);  // cells of a finite size
    EXPECT_LT(std::abs(mean_z / 20000), 0.03);
    // Poles and axes have a cell, too.
    for (int k = 0; k < 3; ++k) {
      for (const float sign : {-1.0f, 1.0f}) {
        Eigen::Vector3f axis = Eigen::Vector3f::Zero();
        axis[k] = sign;
        EXPECT_GT(map.Direction(map.Cell(axis)).dot(axis), std::cos(bound));
      }
    }
  }
}

TEST(TargetLookup, MarksWhatBruteForceMarks) {
  const TriangleMesh part = SteppedPart();
  TargetSampling sampling;
  sampling.spacing_m = 0.004;
  auto targets = SampleTargets(part, sampling);
  ASSERT_TRUE(targets.ok());
  const TargetLookup lookup(*targets, sampling);
  Random random(61);
  const Eigen::AlignedBox3d box = part.BoundingBox();
  const float radius = static_cast<float>(sampling.coverage_radius_m);
  int64_t covered_count = 0, near_count = 0;
  for (int i = 0; i < 4000; ++i) {
    Eigen::Vector3f p, n = random.Direction().cast<float>();
    if (i % 2 == 0) {  // beside a target
      const size_t t = random.Next() % targets->size();
      p = targets->positions_m[t] + (random.Uniform(0, 0.006) * random.Direction()).cast<float>();
      n = (n * 0.4f + targets->normals[t]).normalized();
    } else {  // anywhere, outside the part's box too
      for (int k = 0; k < 3; ++k)
        p[k] = static_cast<float>(random.Uniform(box.min()[k] - 0.02, box.max()[k] + 0.02));
    }
    TargetBits covered(targets->size()), near(targets->size()), want_covered(targets->size()),
        want_near(targets->size());
    lookup.Mark(p, n, covered, near);
    for (size_t t = 0; t < targets->size(); ++t) {
      if ((targets->positions_m[t] - p).squaredNorm() > radius * radius) continue;
      want_near.Set(t);
      if (targets->normals[t].dot(n) >= static_cast<float>(std::cos(sampling.max_normal_angle_rad)))
        want_covered.Set(t);
    }
    ASSERT_TRUE(covered == want_covered && near == want_near) << i;
    covered_count += covered.Count();
    near_count += near.Count();
  }
  EXPECT_GT(covered_count, 500);
  EXPECT_GT(near_count, covered_count + 100);
}

}  // namespace
}  // namespace sightline
