// SPDX-License-Identifier: Apache-2.0
#include "core/resting/resting_faces.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "core/physics/angle.h"
#include "core/rig/scan_geometry.h"

namespace sightline {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

// Upright prism over a convex polygon, counter-clockwise.
TriangleMesh Prism(const Polygon& base, double low_m, double high_m) {
  TriangleMesh mesh;
  const auto n = static_cast<uint32_t>(base.size());
  for (const double z : {low_m, high_m}) {
    for (const auto& p : base) {
      mesh.positions_m.push_back(Eigen::Vector3d(p.x(), p.y(), z).cast<float>());
    }
  }
  for (uint32_t i = 0; i < n; ++i) {
    const uint32_t k = (i + 1) % n;
    mesh.triangles.push_back({i, k, n + k});
    mesh.triangles.push_back({i, n + k, n + i});
    if (i >= 2) {
      mesh.triangles.push_back({0, i, i - 1});
      mesh.triangles.push_back({n, n + i - 1, n + i});
    }
  }
  return mesh;
}

Polygon RegularPolygon(int sides, double radius_m) {
  Polygon polygon;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    polygon.push_back(radius_m * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return polygon;
}

Polygon Rectangle(double x_m, double y_m) {
  return {{-x_m / 2, -y_m / 2}, {x_m / 2, -y_m / 2}, {x_m / 2, y_m / 2}, {-x_m / 2, y_m / 2}};
}

void Append(TriangleMesh& mesh, const TriangleMesh& more) {
  const auto base = static_cast<uint32_t>(mesh.positions_m.size());
  mesh.positions_m.insert(mesh.positions_m.end(), more.positions_m.begin(), more.positions_m.end());
  for (const auto& t : more.triangles) {
    mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  }
}

TriangleMesh Turned(TriangleMesh mesh, const Eigen::Matrix3d& rotation) {
  for (auto& p : mesh.positions_m) {
    p = (rotation * p.cast<double>() + Eigen::Vector3d(0.3, -0.2, 0.1)).cast<float>();
  }
  return mesh;
}

std::vector<RestingFace> FacesOf(const TriangleMesh& mesh) {
  const auto hull = MakeConvexHull(mesh.positions_m);
  EXPECT_TRUE(hull.ok()) << hull.status();
  return hull.ok() ? FindRestingFaces(*hull, MassCentre(mesh, *hull)) : std::vector<RestingFace>();
}

// The angles put the normal straight down, and the outline is what is lowest then.
void ExpectLiesFlat(const TriangleMesh& mesh, const RestingFace& face) {
  Measurement m;
  m.part_alpha_rad = face.part_alpha_rad;
  m.part_beta_rad = face.part_beta_rad;
  const Eigen::Matrix3d rotation = MakeScanGeometry(Rig(), m).part_rotation;
  EXPECT_LT((rotation * face.normal + Eigen::Vector3d::UnitZ()).norm(), 2e-5) << face.name;
  double lowest_m = 1e9;
  for (const auto& p : mesh.positions_m) {
    lowest_m = std::min(lowest_m, (rotation * p.cast<double>()).z());
  }
  const double size_m = mesh.BoundingBox().diagonal().norm();
  EXPECT_NEAR((rotation * face.centre_m).z(), lowest_m, 1e-4 * size_m) << face.name;
}

TEST(RestingFaces, ABoxHasSixTheLargestFirst) {
  const TriangleMesh box = Prism(Rectangle(0.06, 0.04), 0, 0.02);
  const auto faces = FacesOf(box);
  ASSERT_EQ(faces.size(), 6u);
  EXPECT_EQ(faces[0].name, "A");
  EXPECT_EQ(faces[5].name, "F");
  // As the CAD model stands comes first; on 60 x 40 mm it topples over the long edge, 20 mm away.
  EXPECT_LT((faces[0].normal + Eigen::Vector3d::UnitZ()).norm(), 1e-6);
  EXPECT_EQ(faces[0].part_alpha_rad, 0);
  EXPECT_EQ(faces[0].part_beta_rad, 0);
  EXPECT_NEAR(faces[0].area_m2, 0.06 * 0.04, 1e-8);
  EXPECT_NEAR(faces[0].stability_rad, std::atan(20.0 / 10), 1e-5);
  EXPECT_NEAR(faces[1].stability_rad, std::atan(20.0 / 10), 1e-5);
  EXPECT_NEAR(faces[2].stability_rad, std::atan(10.0 / 20), 1e-5);
  EXPECT_NEAR(faces[4].stability_rad, std::atan(10.0 / 30), 1e-5);
  for (const RestingFace& face : faces) ExpectLiesFlat(box, face);
}

TEST(RestingFaces, ARoundBodyStandsOnItsEndsAndRollsOnItsSide) {
  for (const int sides : {12, 18, 24, 36, 64, 200}) {
    const TriangleMesh cylinder = Prism(RegularPolygon(sides, 0.02), 0, 0.05);
    const auto faces = FacesOf(cylinder);
    ASSERT_EQ(faces.size(), 2u) << sides;
    for (const RestingFace& face : faces) {
      EXPECT_NEAR(std::abs(face.normal.z()), 1, 1e-9);
      EXPECT_NEAR(face.stability_rad, std::atan(0.02 * std::cos(std::numbers::pi / sides) / 0.025),
                  1e-4);
      EXPECT_EQ(face.outline_m.size(), static_cast<size_t>(sides));
    }
  }
  // A hexagonal bar does lie on its sides.
  EXPECT_EQ(FacesOf(Prism(RegularPolygon(6, 0.02), 0, 0.05)).size(), 8u);
}

TEST(RestingFaces, ATetrahedronLiesOnEachFace) {
  TriangleMesh mesh;
  mesh.positions_m = {{0, 0, 0}, {0.1f, 0, 0}, {0.05f, 0.0866f, 0}, {0.05f, 0.0289f, 0.0816f}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  const auto faces = FacesOf(mesh);
  ASSERT_EQ(faces.size(), 4u);
  for (const RestingFace& face : faces) {
    ExpectLiesFlat(mesh, face);
    // Foot of the centre to an edge: a / (2 sqrt 3); its height: a sqrt(6) / 12.
    EXPECT_NEAR(face.stability_rad, std::atan(0.28868 / 0.20412), 2e-3);
  }
}

TEST(RestingFaces, MassThatIsOffTopplesIt) {
  // A thin foot with a heavy head that overhangs it.
  TriangleMesh part = Prism(Rectangle(0.02, 0.02), 0, 0.05);
  Append(part, Prism({{0.0, -0.03}, {0.2, -0.03}, {0.2, 0.03}, {0.0, 0.03}}, 0.05, 0.09));
  for (const RestingFace& face : FacesOf(part)) {
    EXPECT_GT((face.normal + Eigen::Vector3d::UnitZ()).norm(), 0.1);  // not on its foot
    ExpectLiesFlat(part, face);
  }
  // A slender post, which a tilt of 2.9 degrees topples, does not count as standing.
  const auto post = FacesOf(Prism(Rectangle(0.01, 0.01), 0, 0.2));
  ASSERT_EQ(post.size(), 4u);
  for (const RestingFace& face : post) EXPECT_NEAR(face.normal.z(), 0, 1e-9);
}

TEST(RestingFaces, DoNotDependOnHowTheModelIsTurned) {
  TriangleMesh part = Prism(Rectangle(0.08, 0.05), 0, 0.01);
  Append(part, Prism(Rectangle(0.01, 0.05), 0.01, 0.04));
  const auto plain = FacesOf(part);
  ASSERT_GE(plain.size(), 4u);
  const Eigen::Matrix3d rotation =
      (Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -0.5).normalized())).toRotationMatrix();
  const TriangleMesh turned_part = Turned(part, rotation);
  const auto turned = FacesOf(turned_part);
  ASSERT_EQ(turned.size(), plain.size());
  for (const RestingFace& face : plain) {
    const Eigen::Vector3d normal = rotation * face.normal;
    const auto same = std::find_if(turned.begin(), turned.end(), [&](const RestingFace& other) {
      return other.normal.dot(normal) > 1 - 1e-7;
    });
    ASSERT_NE(same, turned.end()) << face.name;
    EXPECT_NEAR(same->stability_rad, face.stability_rad, 1e-4);
    EXPECT_NEAR(same->area_m2, face.area_m2, 1e-6);
    ExpectLiesFlat(turned_part, *same);
  }
}

TEST(RestingFaces, AGivenOrientationIsDescribed) {
  const TriangleMesh box = Prism(Rectangle(0.06, 0.04), 0, 0.02);
  const auto hull = MakeConvexHull(box.positions_m);
  ASSERT_TRUE(hull.ok());
  const RestingFace flat = DescribeRest(*hull, MassCentre(box, *hull), 180 * kRadPerDeg, 0);
  EXPECT_NEAR(flat.normal.z(), 1, 1e-9);
  EXPECT_NEAR(flat.stability_rad, std::atan(2.0), 1e-4);
  // On an edge, in a V-block: no face, no stability.
  const RestingFace edge = DescribeRest(*hull, MassCentre(box, *hull), 45 * kRadPerDeg, 0);
  EXPECT_EQ(edge.stability_rad, 0);
  EXPECT_EQ(edge.area_m2, 0);
}

TEST(MassCentre, IsOfTheBodyIfClosedAndOfItsHullElse) {
  TriangleMesh part = Prism(Rectangle(0.1, 0.1), 0, 0.02);
  Append(part, Prism(Rectangle(0.02, 0.02), 0.02, 0.1));
  auto hull = MakeConvexHull(part.positions_m);
  ASSERT_TRUE(hull.ok());
  const double plate = 0.1 * 0.1 * 0.02, post = 0.02 * 0.02 * 0.08;
  EXPECT_NEAR(MassCentre(part, *hull).z(), (plate * 0.01 + post * 0.06) / (plate + post), 1e-8);
  part.triangles.pop_back();
  const double of_hull = MassCentre(part, *hull).z();
  EXPECT_GT(of_hull, 0.02);
  EXPECT_LT(of_hull, 0.05);
}

TEST(ConvexHull, RefusesWhatIsFlat) {
  TriangleMesh plate;
  plate.positions_m = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5f, 0.2f, 0}};
  const auto hull = MakeConvexHull(plate.positions_m);
  EXPECT_EQ(hull.status().code(), absl::StatusCode::kInvalidArgument) << hull.status();
  EXPECT_THAT(std::string(hull.status().message()), ::testing::HasSubstr("flat"));
  EXPECT_FALSE(MakeConvexHull({}).ok());
  const std::vector<Eigen::Vector3f> same(10, Eigen::Vector3f(1, 2, 3));
  EXPECT_FALSE(MakeConvexHull(same).ok());
}

}  // namespace
}  // namespace sightline
