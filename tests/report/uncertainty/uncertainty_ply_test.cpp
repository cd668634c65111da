// SPDX-License-Identifier: Apache-2.0
#include "report/uncertainty/uncertainty_ply.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "tests/report/uncertainty/sample_uncertainty.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

// Reads what the header announces, and nothing that this program shares with the writer.
struct Ply {
  std::vector<std::map<std::string, double>> vertices;
  std::vector<std::array<uint32_t, 3>> faces;
  std::string comments;
};

Ply Parse(const std::string& bytes) {
  Ply ply;
  const std::string mark = "end_header\n";
  size_t at = bytes.find(mark) + mark.size();
  std::istringstream header(bytes.substr(0, at));
  std::string line, element;
  std::map<std::string, size_t> counts;
  std::vector<std::pair<std::string, std::string>> properties;  // of vertices: type, name
  std::getline(header, line);
  EXPECT_EQ(line, "ply");
  std::getline(header, line);
  EXPECT_EQ(line, "format binary_little_endian 1.0");
  while (std::getline(header, line) && line != "end_header") {
    std::istringstream words(line);
    std::string word, type, name;
    words >> word;
    if (word == "comment") ply.comments += line + "\n";
    if (word == "element") words >> element >> counts[element];
    if (word == "property" && element == "vertex") {
      words >> type >> name;
      properties.emplace_back(type, name);
    }
    if (word == "property" && element == "face") {
      EXPECT_EQ(line, "property list uchar int vertex_indices");
    }
  }
  const auto word = [&]() {
    uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value |= uint32_t{static_cast<uint8_t>(bytes.at(at++))} << (8 * i);
    return value;
  };
  for (size_t v = 0; v < counts["vertex"]; ++v) {
    ply.vertices.emplace_back();
    for (const auto& [type, name] : properties) {
      ply.vertices.back()[name] =
          type == "uchar" ? static_cast<uint8_t>(bytes.at(at++)) : std::bit_cast<float>(word());
    }
  }
  for (size_t f = 0; f < counts["face"]; ++f) {
    EXPECT_EQ(bytes.at(at++), 3);
    ply.faces.push_back({word(), word(), word()});
  }
  EXPECT_EQ(at, bytes.size());
  return ply;
}

Eigen::Vector3d Place(const std::map<std::string, double>& vertex) {
  return {vertex.at("x"), vertex.at("y"), vertex.at("z")};
}

TEST(UncertaintyPly, HoldsEveryTargetWithItsParts) {
  const ReportData data = SampleUncertaintyPlan();
  const auto bytes = UncertaintyPly(data.targets, *data.uncertainty, data.measurable);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  const Ply ply = Parse(*bytes);
  ASSERT_EQ(ply.vertices.size(), 100u);
  EXPECT_THAT(ply.comments, HasSubstr("metres"));
  std::map<double, std::array<double, 3>> colours;
  for (size_t i = 0; i < 100; ++i) {
    const auto& vertex = ply.vertices[i];
    EXPECT_EQ(Place(vertex), data.targets.positions_m[i].cast<double>());
    EXPECT_EQ(vertex.at("nz"), 1);
    EXPECT_EQ(vertex.at("uncertainty_m"), static_cast<float>(data.uncertainty->total_m[i]));
    EXPECT_EQ(vertex.at("noise_m"), static_cast<float>(data.uncertainty->noise_m[i]));
    EXPECT_EQ(vertex.at("sampling_m"), static_cast<float>(data.uncertainty->sampling_m[i]));
    EXPECT_EQ(vertex.at("calibration_m"), static_cast<float>(data.uncertainty->calibration_m[i]));
    EXPECT_EQ(vertex.at("admissible_m"), static_cast<float>(data.uncertainty->admissible_m[i]));
    EXPECT_EQ(vertex.at("class"),
              static_cast<int>(ClassOfTarget(*data.uncertainty, data.measurable, i)));
    colours[vertex.at("class")] = {vertex.at("red"), vertex.at("green"), vertex.at("blue")};
  }
  EXPECT_EQ(colours.size(), 5u);
}

TEST(UncertaintyPly, RefusesSizesThatDoNotFit) {
  ReportData data = SampleUncertaintyPlan();
  EXPECT_THAT(UncertaintyPly(data.targets, *data.uncertainty, TargetBits(99)).status().message(),
              HasSubstr("measurable has size 99, must be 100"));
  data.uncertainty->noise_m.clear();
  EXPECT_THAT(UncertaintyPly(data.targets, *data.uncertainty, data.measurable).status().message(),
              HasSubstr("noise_m has size 0"));
}

CovarianceEllipsoid Tilted() {
  const Eigen::Matrix3d axes =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  const Eigen::Vector3d deviations_m(5e-6, 20e-6, 70e-6);
  return {{0.1, -0.2, 0.05}, axes * deviations_m.cwiseAbs2().asDiagonal() * axes.transpose()};
}

TEST(CovarianceEllipsoids, CornersLieOneScaleOfDeviationsAway) {
  const CovarianceEllipsoid ellipsoid = Tilted();
  const double scale = 500;
  const Ply ply = Parse(*CovarianceEllipsoidsPly({{ellipsoid, ellipsoid}}, scale));
  ASSERT_EQ(ply.vertices.size(), 36u);
  ASSERT_EQ(ply.faces.size(), 64u);
  const Eigen::Matrix3d inverse = ellipsoid.covariance_m2.inverse();
  for (const auto& vertex : ply.vertices) {
    const Eigen::Vector3d d = Place(vertex) - ellipsoid.centre_m;
    // Places are floats: 1e-8 m against axes of 2.5 mm and more.
    EXPECT_NEAR(std::sqrt(d.dot(inverse * d)), scale, 1e-4 * scale);
    EXPECT_NEAR(vertex.at("largest_m"), 70e-6, 1e-10);
  }
  EXPECT_THAT(ply.comments, HasSubstr("500 standard deviations"));
}

TEST(CovarianceEllipsoids, MeshIsClosedAndFacesOutward) {
  const Ply ply = Parse(*CovarianceEllipsoidsPly({{Tilted()}}, 1000));
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  double volume = 0;
  const Eigen::Vector3d centre = Tilted().centre_m;
  for (const auto& face : ply.faces) {
    for (int c = 0; c < 3; ++c) ++edges[{face[c], face[(c + 1) % 3]}];
    const auto corner = [&](int c) -> Eigen::Vector3d {
      return Place(ply.vertices[face[c]]) - centre;
    };
    volume += corner(0).dot(corner(1).cross(corner(2))) / 6;
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
  // Volume of the unit sphere's polyhedron: per octant three tetrahedra of 1/12 and one of 1/(6
  // sqrt 2).
  const double axes = 5e-3 * 20e-3 * 70e-3;
  EXPECT_NEAR(volume, (2 + 4 / (3 * std::numbers::sqrt2)) * axes, 1e-4 * axes);
}

TEST(CovarianceEllipsoids, FlatAndPointlikeErrorsAreAllowedImpossibleOnesNot) {
  CovarianceEllipsoid flat{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero()};
  EXPECT_TRUE(CovarianceEllipsoidsPly({{flat}}, 1).ok());
  flat.covariance_m2(2, 2) = 1e-10;
  for (const auto& vertex : Parse(*CovarianceEllipsoidsPly({{flat}}, 1)).vertices) {
    EXPECT_EQ(vertex.at("x"), 0);
    EXPECT_LE(std::abs(vertex.at("z")), 1.0001e-5);
  }
  const auto message = [](const CovarianceEllipsoid& bad, double scale) {
    const auto bytes = CovarianceEllipsoidsPly({{Tilted(), bad}}, scale);
    EXPECT_EQ(bytes.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(bytes.status().message());
  };
  CovarianceEllipsoid bad = Tilted();
  bad.covariance_m2(0, 1) += 1e-10;
  EXPECT_THAT(message(bad, 1), HasSubstr("ellipsoids[1].covariance_m2 is not symmetric"));
  bad = Tilted();
  bad.covariance_m2 -= 1e-9 * Eigen::Matrix3d::Identity();
  EXPECT_THAT(message(bad, 1), HasSubstr("ellipsoids[1].covariance_m2 has a negative variance"));
  bad = Tilted();
  bad.covariance_m2(2, 2) = NAN;
  EXPECT_THAT(message(bad, 1), HasSubstr("is not finite"));
  bad = Tilted();
  bad.centre_m.x() = INFINITY;
  EXPECT_THAT(message(bad, 1), HasSubstr("ellipsoids[1].centre_m is not finite"));
  EXPECT_THAT(message(Tilted(), 0), HasSubstr("scale is 0, must be in (0, 1e6]"));
  EXPECT_THAT(message(Tilted(), NAN), HasSubstr("scale is nan"));
  const std::vector<CovarianceEllipsoid> many(kMostEllipsoids + 1, Tilted());
  EXPECT_THAT(CovarianceEllipsoidsPly(many, 1).status().message(), HasSubstr("at most 20000"));
}

}  // namespace
}  // namespace sightline
