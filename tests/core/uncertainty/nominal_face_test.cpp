// SPDX-License-Identifier: Apache-2.0
// Features of a QIF file bound to a mesh by their nominal geometry.
#include "core/tolerance/nominal_face.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/tolerance/qif/qif_reader.h"

namespace sightline {
namespace {

using Eigen::Vector3d;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kWallFacets = 48;

void AddTriangle(TriangleMesh& mesh, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const auto first = static_cast<uint32_t>(mesh.positions_m.size());
  for (const Vector3d& p : {a, b, c}) mesh.positions_m.push_back(p.cast<float>());
  mesh.triangles.push_back({first, first + 1, first + 2});
}

void AddQuad(TriangleMesh& mesh, const Vector3d& a, const Vector3d& b, const Vector3d& c,
             const Vector3d& d) {
  AddTriangle(mesh, a, b, c);
  AddTriangle(mesh, a, c, d);
}

// A wall of revolution about z from radius r0 at z0 to r1 at z1; `inside`: its normals point to the
// axis.
void AddWall(TriangleMesh& mesh, const Vector3d& axis_m, double r0, double z0, double r1, double z1,
             bool inside) {
  for (int k = 0; k < kWallFacets; ++k) {
    const auto at = [&](int i, double r, double z) {
      const double angle = 2 * std::numbers::pi * i / kWallFacets;
      return Vector3d(axis_m + Vector3d(r * std::cos(angle), r * std::sin(angle), z));
    };
    const Vector3d a = at(k, r0, z0), b = at(k + 1, r0, z0), c = at(k + 1, r1, z1),
                   d = at(k, r1, z1);
    if (inside) {
      AddQuad(mesh, a, d, c, b);
    } else {
      AddQuad(mesh, a, b, c, d);
    }
  }
}

// Two squares at z = 0, a bore of 10 mm and a boss of 10 mm diameter, a cone and two walls 20 mm
// apart.
TriangleMesh Mesh() {
  TriangleMesh mesh;
  AddQuad(mesh, {0, 0, 0}, {0.01, 0, 0}, {0.01, 0.01, 0}, {0, 0.01, 0});
  AddQuad(mesh, {0.02, 0, 0}, {0.03, 0, 0}, {0.03, 0.01, 0}, {0.02, 0.01, 0});
  AddWall(mesh, {0.1, 0, 0}, 0.005, -0.02, 0.005, 0, true);
  AddWall(mesh, {0.2, 0, 0}, 0.005, 0, 0.005, 0.02, false);
  AddWall(mesh, {0.3, 0, 0}, 0.01, 0, 0.005, 0.02, false);
  AddQuad(mesh, {0.4, 0, 0}, {0.4, 0.01, 0}, {0.4, 0.01, 0.01}, {0.4, 0, 0.01});
  AddQuad(mesh, {0.42, 0, 0}, {0.42, 0, 0.01}, {0.42, 0.01, 0.01}, {0.42, 0.01, 0});
  return mesh;
}

constexpr const char* kFeaturesQif =
    R"(<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0">
  <FileUnits><PrimaryUnits>
    <AngularUnit><SIUnitName>radian</SIUnitName><UnitName>degree</UnitName></AngularUnit>
    <LinearUnit><SIUnitName>meter</SIUnitName><UnitName>UNIT</UnitName></LinearUnit>
  </PrimaryUnits></FileUnits>
  <Product><GeometrySet>
      <PointSet><Point id="zzz"><XYZ>no numbers</XYZ></Point></PointSet>
      <SurfaceSet><Plane23 id="101"><Plane23Core domainU="-5 5" domainV="-5 5">
        <Origin>25 5 0</Origin><DirU>1 0 0</DirU><DirV>0 -1 0</DirV></Plane23Core></Plane23>
        <Cylinder23 id="102"><Cylinder23Core><Diameter>10</Diameter><Length>20</Length>
          <Axis><AxisPoint>200 0 0</AxisPoint><Direction>0 0 1</Direction></Axis>
        </Cylinder23Core></Cylinder23>
        <Nurbs23 id="103"/></SurfaceSet></GeometrySet>
    <TopologySet><FaceSet>
      <Face id="111"><Surface><Id>101</Id></Surface></Face>
      <Face id="112"><Surface><Id>102</Id></Surface></Face>
      <Face id="113"><Surface><Id>102</Id></Surface></Face>
      <Face id="114"><Surface><Id>103</Id></Surface></Face>
    </FaceSet></TopologySet></Product>
  <Features>
    <FeatureDefinitions>
      <OtherNonShapeFeatureDefinition id="6"/>
      <PlaneFeatureDefinition id="1"/>
      <CylinderFeatureDefinition id="2"><InternalExternal>SIDE</InternalExternal>
        <Diameter>DIAMETER</Diameter><Length>20</Length></CylinderFeatureDefinition>
      <ConeFeatureDefinition id="3"><InternalExternal>EXTERNAL</InternalExternal>
        <Diameter>20</Diameter><HalfAngle>14.036243467926479</HalfAngle></ConeFeatureDefinition>
      <OppositeParallelPlanesFeatureDefinition id="4"><InternalExternal>INTERNAL</InternalExternal>
        <Width>20</Width><Length>10</Length><Depth>10</Depth>
      </OppositeParallelPlanesFeatureDefinition>
      <LineFeatureDefinition id="5"/>
    </FeatureDefinitions>
    <FeatureNominals>
      <PlaneFeatureNominal id="11"><FeatureDefinitionId>1</FeatureDefinitionId>
        <Location>0 0 0</Location><Normal>0 0 1</Normal>
        <PolyLine count="4">-1 -1 0 11 -1 0 11 11 0 -1 11 0</PolyLine></PlaneFeatureNominal>
      <CylinderFeatureNominal id="12"><FeatureDefinitionId>2</FeatureDefinitionId>
        <Axis><AxisPoint>PLACE 0 0</AxisPoint><Direction>0 0 -2</Direction></Axis>
      </CylinderFeatureNominal>
      <ConeFeatureNominal id="13"><FeatureDefinitionId>3</FeatureDefinitionId>
        <Axis><AxisPoint>300 0 0</AxisPoint><Direction>0 0 1</Direction></Axis>
      </ConeFeatureNominal>
      <OppositeParallelPlanesFeatureNominal id="14"><FeatureDefinitionId>4</FeatureDefinitionId>
        <CenterPlane><Point>410 5 5</Point><Normal>1 0 0</Normal></CenterPlane>
        <LengthVector>0 1 0</LengthVector></OppositeParallelPlanesFeatureNominal>
      <LineFeatureNominal id="15"><FeatureDefinitionId>5</FeatureDefinitionId></LineFeatureNominal>
      <OtherNonShapeFeatureNominal id="16"><FeatureDefinitionId>6</FeatureDefinitionId>
        <EntityInternalIds><Id>111</Id><Id>112</Id><Id>113</Id></EntityInternalIds>
      </OtherNonShapeFeatureNominal>
      <OtherNonShapeFeatureNominal id="17"><FeatureDefinitionId>6</FeatureDefinitionId>
        <EntityInternalIds><Id>111</Id><Id>114</Id></EntityInternalIds>
      </OtherNonShapeFeatureNominal>
    </FeatureNominals>
  </Features>
  <Characteristics>
    <CharacteristicDefinitions><FlatnessCharacteristicDefinition id="21">
      <ToleranceValue>0.1</ToleranceValue></FlatnessCharacteristicDefinition>
    </CharacteristicDefinitions>
    <CharacteristicNominals>
      <FlatnessCharacteristicNominal id="31"><CharacteristicDefinitionId>21</CharacteristicDefinitionId>
        <FeatureNominalIds><Id>11</Id><Id>12</Id><Id>13</Id><Id>14</Id><Id>15</Id></FeatureNominalIds>
      </FlatnessCharacteristicNominal>
      <FlatnessCharacteristicNominal id="32"><CharacteristicDefinitionId>21</CharacteristicDefinitionId>
        <FeatureNominalIds><Id>16</Id></FeatureNominalIds></FlatnessCharacteristicNominal>
      <FlatnessCharacteristicNominal id="33"><CharacteristicDefinitionId>21</CharacteristicDefinitionId>
        <FeatureNominalIds><Id>17</Id></FeatureNominalIds></FlatnessCharacteristicNominal>
    </CharacteristicNominals>
  </Characteristics>
</QIFDocument>)";

class NominalFaceTest : public ::testing::Test {
 protected:
  absl::StatusOr<ToleranceReport> Read(const std::string& side = "INTERNAL",
                                       const std::string& place = "100",
                                       const std::string& diameter = "10",
                                       const std::string& unit = "mm") {
    return ReadText(absl::StrReplaceAll(
        kFeaturesQif, {{"SIDE", side}, {"PLACE", place}, {"DIAMETER", diameter}, {"UNIT", unit}}));
  }
  absl::StatusOr<ToleranceReport> ReadText(const std::string& text) {
    const auto path = std::filesystem::path(::testing::TempDir()) / "nominal_face.qif";
    std::ofstream(path) << text;
    auto report = ReadQif(path.string());
    std::filesystem::remove(path);
    return report;
  }
  // Numbers of triangles on every face, by its number; 0 where none lies on it.
  static std::vector<size_t> Triangles(const ToleranceReport& report) {
    std::vector<size_t> counts(5, 0);
    for (const FaceTriangles& face : FacesOnMesh(report.nominal_faces, Mesh())) {
      if (face.face > 5) continue;
      counts[static_cast<size_t>(face.face - 1)] = face.triangles.size();
    }
    return counts;
  }
};

TEST_F(NominalFaceTest, EveryFeatureFindsItsTriangles) {
  const auto report = Read();
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_EQ(report->read.size(), 3u);
  // A width has two faces; that of a line is found nowhere.
  EXPECT_THAT(report->read[0].faces, ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_EQ(report->nominal_faces[5].surface.kind, SurfaceKind::kFreeform);
  EXPECT_THAT(report->nominal_faces[1].feature, HasSubstr("cylinder (feature 12)"));
  // Two squares lie in one plane; one is within the outline.
  EXPECT_THAT(Triangles(*report), ElementsAre(2, 2 * kWallFacets, 2 * kWallFacets, 2, 2));
}

TEST_F(NominalFaceTest, FacesOfTheProductStandForOtherFeatures) {
  const auto report = Read();
  ASSERT_TRUE(report.ok()) << report.status();
  // Both halves of the boss are one surface.
  EXPECT_THAT(report->read[1].faces, ElementsAre(7, 8));
  size_t square = 0, boss = 0;
  for (const FaceTriangles& face : FacesOnMesh(report->nominal_faces, Mesh())) {
    if (face.face == 7) square = face.triangles.size();
    if (face.face == 8) boss = face.triangles.size();
    if (face.face == 7) {
      EXPECT_GT(face.positions_m[0].x(), 0.015);
    }
  }
  EXPECT_EQ(square, 2);
  EXPECT_EQ(boss, 2 * kWallFacets);
  // A feature is bound as a whole or not at all.
  ASSERT_THAT(report->read[2].faces, ElementsAre(9));
  EXPECT_EQ(report->nominal_faces[8].surface.kind, SurfaceKind::kFreeform);
}

TEST_F(NominalFaceTest, SideSizeAndPlaceMustAgree) {
  EXPECT_THAT(Triangles(*Read("EXTERNAL", "100")), ElementsAre(2, 0, 2 * kWallFacets, 2, 2));
  EXPECT_THAT(Triangles(*Read("EXTERNAL", "200")),
              ElementsAre(2, 2 * kWallFacets, 2 * kWallFacets, 2, 2));
  EXPECT_THAT(Triangles(*Read("NOT_APPLICABLE", "200"))[1], 2 * kWallFacets);
  EXPECT_THAT(Triangles(*Read("INTERNAL", "100", "10.018"))[1], 2 * kWallFacets);  // 9 um off
  EXPECT_THAT(Triangles(*Read("INTERNAL", "100", "10.022"))[1], 0);                // 11 um off
  // Strips of the wall lie within 10 um of a bore that is 20 um out of place; the bore does not.
  EXPECT_THAT(Triangles(*Read("INTERNAL", "100.02"))[1], 0);
  EXPECT_THAT(Triangles(*Read("INTERNAL", "100.005"))[1], 2 * kWallFacets);
  // The same numbers in inches are somewhere else.
  EXPECT_THAT(Triangles(*Read("INTERNAL", "100", "10", "inch"))[1], 0);
}

TEST_F(NominalFaceTest, SegmentsOfCompositeTolerancesAreTolerances) {
  const std::string text = absl::StrReplaceAll(
      kFeaturesQif,
      {{"SIDE", "INTERNAL"},
       {"PLACE", "100"},
       {"DIAMETER", "10"},
       {"UNIT", "mm"},
       {"<ToleranceValue>0.1</ToleranceValue>",
        "<ToleranceValue>0.1</ToleranceValue><SecondCompositeSegmentProfileDefinition>"
        "<ToleranceValue>0.02</ToleranceValue></SecondCompositeSegmentProfileDefinition>"
        "<ThirdCompositeSegmentProfileDefinition/>"}});
  const auto report = ReadText(text);
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_EQ(report->read.size(), 6u);
  EXPECT_EQ(report->read[1].id, "31.2");
  EXPECT_THAT(report->read[1].name, HasSubstr("segment 2"));
  EXPECT_NEAR(report->read[1].zone_width_m, 2e-5, 1e-15);
  EXPECT_EQ(report->read[1].faces, report->read[0].faces);
  ASSERT_EQ(report->not_read.size(), 3u);
  EXPECT_THAT(report->not_read[0].name, HasSubstr("segment 3"));
  EXPECT_EQ(report->entity_count, 9);
}

TEST_F(NominalFaceTest, UnitsOfThePmiAreNotThoseOfGeometry) {
  const std::string text = absl::StrReplaceAll(
      kFeaturesQif, {{"SIDE", "INTERNAL"},
                     {"PLACE", "100"},
                     {"DIAMETER", "10"},
                     {"UNIT", "mm"},
                     {"</PrimaryUnits>",
                      "<PMILinearUnit><SIUnitName>meter</SIUnitName><UnitName>inch</UnitName>"
                      "</PMILinearUnit></PrimaryUnits>"}});
  const auto report = ReadText(text);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_NEAR(report->read[0].zone_width_m, 0.1 * 0.0254, 1e-12);
  EXPECT_THAT(Triangles(*report), ElementsAre(2, 2 * kWallFacets, 2 * kWallFacets, 2, 2));
}

TEST_F(NominalFaceTest, NumbersThatAreNoneAreRefusedWithTheirLine) {
  const auto error = [&](const std::string& from, const std::string& to) {
    const std::string text = absl::StrReplaceAll(
        kFeaturesQif,
        {{"SIDE", "INTERNAL"}, {"PLACE", "100"}, {"DIAMETER", "10"}, {"UNIT", "mm"}, {from, to}});
    const auto report = ReadText(text);
    return report.ok() ? "accepted" : std::string(report.status().message());
  };
  EXPECT_THAT(error("0 0 -2", "0 0 0"), HasSubstr(":38: <Direction>: is no direction"));
  EXPECT_THAT(error("0 0 -2", "0 -2"), HasSubstr("<Direction>: has 2 numbers, must have 3"));
  EXPECT_THAT(error("0 0 -2", "0 x -2"), HasSubstr("<Direction>"));
  EXPECT_THAT(error("count=\"4\"", "count=\"5\""), HasSubstr("<PolyLine>: has 12 numbers"));
  EXPECT_THAT(error("count=\"4\"", "count=\"-4\""), HasSubstr("<PolyLine>: attribute count"));
  EXPECT_THAT(error("<HalfAngle>14.", "<HalfAngle>a14."), HasSubstr("<HalfAngle>"));
  EXPECT_THAT(error("<Diameter>20</Diameter>", "<Diameter>-20</Diameter>"),
              HasSubstr("<Diameter>: must be above 0"));
  EXPECT_THAT(error("<FeatureNominalIds><Id>16", "<FeatureNominalIds n=\"3\"><Id>16"),
              HasSubstr("attribute n is 3; it has 1 elements"));
  // A missing element is no error: the feature has no face.
  EXPECT_EQ(error("<Diameter>20</Diameter>", ""), "accepted");
}

}  // namespace
}  // namespace sightline
