// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <random>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/json/strict_json.h"
#include "core/tolerance/face_surface.h"
#include "core/tolerance/qif/qif_reader.h"
#include "core/tolerance/tolerance_proto.h"
#include "tests/limits/within_limits.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kInf = std::numeric_limits<double>::infinity();

// --- Admissible uncertainty -----------------------------------------------------------------

TEST(AdmissibleUncertaintyTest, ThesisRuleIsAQuarterOfTheZone) {
  EXPECT_DOUBLE_EQ(AdmissibleUncertainty(0.1e-3, {}), 0.025e-3);
}

TEST(AdmissibleUncertaintyTest, LeavesJustTheAcceptanceZoneAskedFor) {
  for (const double guard : {1.0, 1.65, 2.0, 3.0}) {
    for (const double least : {0.0, 0.25, 0.5, 0.9}) {
      const double zone_m = 0.2e-3;
      const double u_m = AdmissibleUncertainty(zone_m, {guard, least});
      EXPECT_NEAR(zone_m - 2 * guard * u_m, least * zone_m, 1e-18) << guard << " " << least;
    }
  }
}

TEST(DecisionRuleTest, RangesAreNamed) {
  EXPECT_TRUE(CheckDecisionRule({}).ok());
  EXPECT_TRUE(CheckDecisionRule({1.65, 0.99}).ok());
  for (const double wrong : {0.0, -1.0, 10.5, kInf, std::nan("")}) {
    EXPECT_THAT(std::string(CheckDecisionRule({wrong, 0}).message()),
                AllOf(HasSubstr("guard_factor"), HasSubstr("(0, 10]")));
  }
  for (const double wrong : {1.0, -0.1, std::nan("")}) {
    EXPECT_THAT(std::string(CheckDecisionRule({2, wrong}).message()),
                AllOf(HasSubstr("least_acceptance_zone"), HasSubstr("[0, 1)")));
  }
}

Tolerance Flatness(double zone_width_m) {
  Tolerance tolerance;
  tolerance.id = "#57";
  tolerance.name = "Flatness.1";
  tolerance.zone_width_m = zone_width_m;
  return tolerance;
}

TEST(CheckToleranceTest, NamesToleranceValueAndRange) {
  EXPECT_TRUE(CheckTolerance(Flatness(0.2e-3), 0.8).ok());
  for (const double wrong : {0.0, -1e-3, kInf, std::nan("")}) {
    EXPECT_THAT(std::string(CheckTolerance(Flatness(wrong), 0.8).message()),
                AllOf(HasSubstr("Flatness.1 (#57)"), HasSubstr("zone_width_m")));
  }
  // Millimetres taken for metres.
  EXPECT_THAT(std::string(CheckTolerance(Flatness(0.9), 0.8).message()), HasSubstr("unit"));
  Tolerance angle = Flatness(0);
  angle.kind = ToleranceKind::kAngularSize;
  angle.zone_width_rad = 0.01;
  EXPECT_THAT(std::string(CheckTolerance(angle, 0.8).message()), HasSubstr("angle"));
}

// --- JSON -------------------------------------------------------------------------------------

ToleranceReport FullReport() {
  ToleranceReport report;
  report.file = "part.stp";
  report.standard = "AP242";
  Tolerance size = Flatness(0.15e-3);
  size.kind = ToleranceKind::kLinearSize;
  size.nominal_m = 0.02;
  size.lower_m = 0.0199;
  size.upper_m = 0.02005;
  size.faces = {3, 7};
  size.datums = {"A", "B(M)", "C-D"};
  size.modifiers = {"free state"};
  size.text = "diameter 20 +0.05/-0.1 mm";
  Tolerance angle = Flatness(0);
  angle.kind = ToleranceKind::kAngularDistance;
  angle.zone_width_rad = 0.02;
  angle.nominal_rad = 1;
  angle.lower_rad = 0.99;
  angle.upper_rad = 1.01;
  angle.features = {"cone 3"};
  report.read = {Flatness(0.2e-3), size, angle};
  report.read[0].diameter_zone = true;
  report.untoleranced = {size};
  report.untoleranced[0].zone_width_m = 0;
  report.untoleranced[0].lower_m.reset();
  report.untoleranced[0].upper_m.reset();
  report.datums = {{"#9", "A", false, {1}, {}}, {"#10", "A1", true, {}, {"point"}}};
  report.not_read = {{"Position.4 (#12)", "its zone is not of one width"}};
  report.entity_count = 7;
  report.notes = {"a note"};
  return report;
}

TEST(ToleranceProtoTest, SurvivesTheFile) {
  const FaceTriangles face{3, {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 1e-9}}, {{0, 1, 2}}};
  const std::string json = ToJson(ToleranceReportToProto(FullReport(), {face}));
  v1::ToleranceReport message;
  ASSERT_TRUE(ParseStrictJson(json, "report.json", &message).ok());
  const auto report = ToleranceReportFromProto(message);
  ASSERT_TRUE(report.ok()) << report.status();
  const auto faces = FacesFromProto(message);
  ASSERT_TRUE(faces.ok()) << faces.status();
  ASSERT_THAT(*faces, SizeIs(1));
  EXPECT_EQ((*faces)[0].positions_m[2], Vector3d(0, 0.1, 1e-9));
  // Same bytes again: nothing was lost on the way.
  EXPECT_EQ(ToJson(ToleranceReportToProto(*report, *faces)), json);
  EXPECT_EQ(report->read[1].kind, ToleranceKind::kLinearSize);
  EXPECT_FALSE(report->read[0].nominal_m.has_value());
  EXPECT_EQ(report->read[2].lower_rad, 0.99);
  EXPECT_TRUE(report->datums[1].target);
}

TEST(ToleranceProtoTest, EveryKindHasItsOwnName) {
  for (int k = v1::TOLERANCE_KIND_FLATNESS; k <= v1::TOLERANCE_KIND_ANGULAR_DISTANCE; ++k) {
    ToleranceReport report;
    report.read = {Flatness(1e-3)};
    report.read[0].kind = static_cast<ToleranceKind>(k - 1);
    const v1::ToleranceReport message = ToleranceReportToProto(report, {});
    // "TOLERANCE_KIND_LINEAR_SIZE" of "linear size".
    std::string name = absl::StrReplaceAll(ToleranceKindName(report.read[0].kind), {{" ", "_"}});
    for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    EXPECT_EQ(v1::ToleranceKind_Name(message.read(0).kind()), "TOLERANCE_KIND_" + name);
  }
}

TEST(ToleranceProtoTest, WrongFieldsAreNamed) {
  const auto error = [](auto&& change) {
    v1::ToleranceReport message = ToleranceReportToProto(FullReport(), {});
    change(message);
    const auto report = ToleranceReportFromProto(message);
    return report.ok() ? std::string("accepted") : std::string(report.status().message());
  };
  EXPECT_THAT(error([](auto& m) { m.mutable_read(1)->clear_kind(); }), HasSubstr("read[1].kind"));
  EXPECT_THAT(error([](auto& m) { m.mutable_read(1)->clear_name(); }), HasSubstr("read[1].name"));
  EXPECT_THAT(error([](auto& m) { m.mutable_read(0)->set_zone_width_m(-1); }),
              HasSubstr("read[0].zone_width_m"));
  EXPECT_THAT(error([](auto& m) { m.mutable_read(0)->set_zone_width_m(kInf); }),
              HasSubstr("read[0].zone_width_m"));
  EXPECT_THAT(error([](auto& m) { m.mutable_read(1)->set_lower_m(1); }),
              HasSubstr("read[1].lower_m"));
  EXPECT_THAT(error([](auto& m) { m.mutable_read(1)->set_faces(1, 0); }),
              HasSubstr("read[1].faces[1]"));
  EXPECT_THAT(error([](auto& m) { m.mutable_datums(0)->set_faces(0, -3); }),
              HasSubstr("datums[0].faces[0]"));
}

TEST(ToleranceProtoTest, WrongFacesAreNamed) {
  const FaceTriangles face{3, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  const auto error = [&](auto&& change) {
    v1::ToleranceReport message = ToleranceReportToProto({}, {face, face});
    message.mutable_faces(1)->set_face(4);
    change(*message.mutable_faces(1));
    const auto faces = FacesFromProto(message);
    return faces.ok() ? std::string("accepted") : std::string(faces.status().message());
  };
  EXPECT_EQ(error([](auto&) {}), "accepted");
  EXPECT_THAT(error([](auto& f) { f.set_face(3); }), HasSubstr("faces[1].face"));
  EXPECT_THAT(error([](auto& f) { f.add_positions_m(0); }), HasSubstr("faces[1].positions_m"));
  EXPECT_THAT(error([](auto& f) { f.add_triangles(0); }), HasSubstr("faces[1].triangles"));
  EXPECT_THAT(error([](auto& f) { f.set_triangles(0, 3); }), HasSubstr("faces[1].triangles[0]"));
  EXPECT_THAT(error([](auto& f) { f.set_positions_m(0, kInf); }), HasSubstr("not finite"));
}

// --- Faces --------------------------------------------------------------------------------------

TEST(DistanceToTriangleTest, IsTheLeastDistanceToItsPoints) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto draw = [&] { return Vector3d(uniform(random), uniform(random), uniform(random)); };
  for (int trial = 0; trial < 200; ++trial) {
    const Vector3d a = draw(), b = draw(), c = draw(), p = 2 * draw();
    const double distance = DistanceToTriangle(p, a, b, c);
    double least = kInf;
    constexpr int kSteps = 150;
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        const double u = i / double{kSteps}, v = j / double{kSteps};
        least = std::min(least, (p - (a + u * (b - a) + v * (c - a))).norm());
      }
    }
    // Samples are at most a step's length from the nearest point.
    EXPECT_LE(distance, least + 1e-12);
    EXPECT_GE(distance, least - ((b - a).norm() + (c - a).norm()) / kSteps);
  }
}

// Quarter of a cylinder about z, normals outward.
FaceTriangles QuarterCylinder(int face, double radius_m, double length_m, int sides, int rows) {
  FaceTriangles out;
  out.face = face;
  for (int r = 0; r <= rows; ++r) {
    for (int s = 0; s <= sides; ++s) {
      const double angle = std::numbers::pi / 2 * s / sides;
      out.positions_m.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle),
                                   length_m * r / rows);
    }
  }
  const auto at = [&](int r, int s) { return static_cast<uint32_t>(r * (sides + 1) + s); };
  for (int r = 0; r < rows; ++r) {
    for (int s = 0; s < sides; ++s) {
      out.triangles.push_back({at(r, s), at(r, s + 1), at(r + 1, s)});
      out.triangles.push_back({at(r, s + 1), at(r + 1, s + 1), at(r + 1, s)});
    }
  }
  return out;
}

TEST(FaceSurfaceTest, AgreesWithTryingEveryTriangle) {
  const FaceTriangles face = QuarterCylinder(1, 0.02, 0.05, 12, 5);
  const FaceMatch match{3e-4, 0.5};
  const auto surface = FaceSurface::Make(face, match);
  ASSERT_TRUE(surface.ok()) << surface.status();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> angle(-0.3, 2), height(-0.005, 0.055), off(-6e-4, 6e-4),
      tilt(-0.6, 0.6);
  int inside = 0;
  constexpr int kTrials = 20000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const double a = angle(random), r = 0.02 + off(random), turned = a + tilt(random);
    const Vector3d p(r * std::cos(a), r * std::sin(a), height(random));
    const Vector3d n = 3 * Vector3d(std::cos(turned), std::sin(turned), 0);
    bool expected = false;
    for (const auto& t : face.triangles) {
      const Vector3d &q0 = face.positions_m[t[0]], &q1 = face.positions_m[t[1]],
                     &q2 = face.positions_m[t[2]];
      const Vector3d normal = (q1 - q0).cross(q2 - q0).normalized();
      expected = expected || (normal.dot(n) >= std::cos(0.5) * n.norm() &&
                              DistanceToTriangle(p, q0, q1, q2) <= 3e-4);
    }
    EXPECT_EQ(surface->Contains(p, n), expected) << trial;
    inside += expected ? 1 : 0;
  }
  // Both answers come often enough to mean something.
  EXPECT_GT(inside, kTrials / 10);
  EXPECT_LT(inside, kTrials * 9 / 10);
}

TEST(FaceSurfaceTest, FindsItselfAcrossTriangulationsAndTellsBothSides) {
  // Coarse chords are 0.05 mm off at r = 20 mm with 11 sides; the finer mesh lies outside them.
  const auto surface = FaceSurface::Make(QuarterCylinder(1, 0.02, 0.05, 11, 1));
  ASSERT_TRUE(surface.ok());
  const double chord_m = 2 * 0.02 * std::sin(std::numbers::pi / 44);
  EXPECT_NEAR(surface->area_m2(), 11 * chord_m * 0.05, 1e-15);
  const FaceTriangles fine = QuarterCylinder(1, 0.02, 0.05, 64, 8);
  for (const Vector3d& p : fine.positions_m) {
    const Vector3d out = Vector3d(p.x(), p.y(), 0).normalized();
    EXPECT_TRUE(surface->Contains(p, out));
    EXPECT_FALSE(surface->Contains(p, -out));
    EXPECT_FALSE(surface->Contains(p + 3e-4 * out, out));
    // The opposite wall of a sheet 0.1 mm thin is within reach but looks the other way.
    EXPECT_FALSE(surface->Contains(p - 1e-4 * out, -out));
  }
  EXPECT_FALSE(surface->Contains(Vector3d::Constant(std::nan("")), Vector3d::UnitX()));
  EXPECT_FALSE(surface->Contains({0.02, 0, 0.02}, Vector3d::Constant(std::nan(""))));
}

TEST(FaceSurfaceTest, TwentyThousandTargetsOnAHundredFacesTakeNoTime) {
  std::vector<FaceSurface> faces;
  for (int i = 0; i < 100; ++i) {
    auto surface = FaceSurface::Make(QuarterCylinder(i + 1, 0.01 + 0.001 * i, 0.1, 60, 10));
    ASSERT_TRUE(surface.ok());
    faces.push_back(*std::move(surface));
  }
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(0, std::numbers::pi / 2), height(0, 0.1);
  std::uniform_int_distribution<int> which(0, 99);
  std::vector<Vector3d> points, normals;
  for (int i = 0; i < 20000; ++i) {
    const double a = angle(random), r = 0.01 + 0.001 * which(random);
    normals.emplace_back(std::cos(a), std::sin(a), 0);
    points.emplace_back(r * normals.back() + height(random) * Vector3d::UnitZ());
  }
  // Each with each of the 120000 triangles would be 2.4 billion distances.
  const std::string said = WithinLimits({.cpu_time_s = 5}, [&] {
    size_t found = 0;
    for (const FaceSurface& face : faces) {
      found += PointsOnFaces({&face, 1}, points, normals).size();
    }
    return absl::StrCat(found);
  });
  EXPECT_EQ(said, absl::StrCat(points.size()));  // surfaces are 1 mm apart: each point is on one
  EXPECT_THAT(PointsOnFaces(faces, points, normals), SizeIs(points.size()));
}

TEST(FaceSurfaceTest, WrongFacesAreRefused) {
  const FaceTriangles good = QuarterCylinder(4, 0.02, 0.05, 3, 1);
  const auto error = [&](FaceTriangles face, const FaceMatch& match) {
    const auto surface = FaceSurface::Make(std::move(face), match);
    return surface.ok() ? std::string("accepted") : std::string(surface.status().message());
  };
  EXPECT_THAT(error(good, {0, 0.5}), AllOf(HasSubstr("face 4"), HasSubstr("max_distance_m")));
  EXPECT_THAT(error(good, {1, 0.5}), HasSubstr("max_distance_m"));
  EXPECT_THAT(error(good, {1e-4, 0}), HasSubstr("max_normal_angle_rad"));
  EXPECT_THAT(error(good, {1e-4, std::nan("")}), HasSubstr("max_normal_angle_rad"));
  FaceTriangles wrong = good;
  wrong.triangles[0][1] = 99;
  EXPECT_THAT(error(wrong, {}), HasSubstr("index 99"));
  wrong = good;
  wrong.positions_m[0].x() = kInf;
  EXPECT_THAT(error(wrong, {}), HasSubstr("not finite"));
  wrong = good;
  for (Vector3d& p : wrong.positions_m) p.setZero();
  EXPECT_THAT(error(wrong, {}), HasSubstr("no triangle with area"));
}

// --- QIF
// ------------------------------------------------------------------------------------------

// Written for this test. Millimetres, with one value in inches.
constexpr const char* kQif = R"(<?xml version="1.0" encoding="UTF-8"?>
<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" idMax="90" versionQIF="3.0.0">
  <FileUnits>
    <PrimaryUnits>
      <LinearUnit><SIUnitName>meter</SIUnitName><UnitName>mm</UnitName>
        <UnitConversion><Factor>0.001</Factor></UnitConversion></LinearUnit>
      <AngularUnit><SIUnitName>radian</SIUnitName><UnitName>degree</UnitName>
        <UnitConversion><Factor>0.017453292519943295</Factor></UnitConversion></AngularUnit>
    </PrimaryUnits>
    <OtherUnits n="1">
      <LinearUnit><SIUnitName>meter</SIUnitName><UnitName>inch</UnitName>
        <UnitConversion><Factor>0.0254</Factor></UnitConversion></LinearUnit>
    </OtherUnits>
  </FileUnits>
  <DatumDefinitions n="2">
    <DatumDefinition id="1"><DatumLabel>A</DatumLabel>
      <FeatureNominalIds n="1"><Id>11</Id></FeatureNominalIds></DatumDefinition>
    <DatumDefinition id="2"><DatumLabel>B</DatumLabel></DatumDefinition>
  </DatumDefinitions>
  <DatumReferenceFrames n="1">
    <DatumReferenceFrame id="3"><Datums n="2">
      <Datum><SimpleDatum><DatumDefinitionId>2</DatumDefinitionId>
        <MaterialModifier>MAXIMUM</MaterialModifier></SimpleDatum>
        <Precedence><PrecedenceEnum>SECONDARY</PrecedenceEnum></Precedence></Datum>
      <Datum><SimpleDatum><DatumDefinitionId>1</DatumDefinitionId></SimpleDatum>
        <Precedence><PrecedenceEnum>PRIMARY</PrecedenceEnum></Precedence></Datum>
    </Datums></DatumReferenceFrame>
  </DatumReferenceFrames>
  <Product><Deep><Deeper id="zzz">read past</Deeper></Deep></Product>
  <Features>
    <FeatureNominals n="2">
      <PlaneFeatureNominal id="11"><Name>top</Name>
        <EntityInternalIds n="1"><Id>501</Id></EntityInternalIds></PlaneFeatureNominal>
      <CylinderFeatureNominal id="12">
        <EntityInternalIds n="2"><Id>561</Id><Id>566</Id></EntityInternalIds>
      </CylinderFeatureNominal>
    </FeatureNominals>
    <FeatureItems n="1">
      <CylinderFeatureItem id="13"><FeatureNominalId>12</FeatureNominalId>
        <FeatureName>HOLE1</FeatureName></CylinderFeatureItem>
    </FeatureItems>
  </Features>
  <Characteristics>
    <CharacteristicDefinitions n="8">
      <FlatnessCharacteristicDefinition id="21"><ToleranceValue>0.2</ToleranceValue>
      </FlatnessCharacteristicDefinition>
      <PositionCharacteristicDefinition id="22"><ToleranceValue linearUnit="inch">0.01</ToleranceValue>
        <DatumReferenceFrameId>3</DatumReferenceFrameId>
        <MaterialCondition>MAXIMUM</MaterialCondition>
        <ZoneShape><DiametricalZone/></ZoneShape></PositionCharacteristicDefinition>
      <DiameterCharacteristicDefinition id="23"><Tolerance><MaxValue>0.05</MaxValue>
        <MinValue>-0.1</MinValue><DefinedAsLimit>false</DefinedAsLimit></Tolerance>
      </DiameterCharacteristicDefinition>
      <DiameterCharacteristicDefinition id="24"><Tolerance><MaxValue>35.2</MaxValue>
        <MinValue>34.8</MinValue><DefinedAsLimit>true</DefinedAsLimit></Tolerance>
      </DiameterCharacteristicDefinition>
      <AngleCharacteristicDefinition id="25"><Tolerance><MaxValue>0.5</MaxValue>
        <MinValue>-0.5</MinValue><DefinedAsLimit>false</DefinedAsLimit></Tolerance>
      </AngleCharacteristicDefinition>
      <DiameterCharacteristicDefinition id="26"><NonTolerance>BASIC</NonTolerance>
      </DiameterCharacteristicDefinition>
      <SurfaceTextureCharacteristicDefinition id="27"/>
      <FlatnessCharacteristicDefinition id="28"><ToleranceValue>0.3</ToleranceValue>
      </FlatnessCharacteristicDefinition>
    </CharacteristicDefinitions>
    <CharacteristicNominals n="7">
      <FlatnessCharacteristicNominal id="31"><CharacteristicDefinitionId>21</CharacteristicDefinitionId>
        <FeatureNominalIds n="1"><Id>11</Id></FeatureNominalIds><Name>Flatness.1</Name>
      </FlatnessCharacteristicNominal>
      <PositionCharacteristicNominal id="32"><CharacteristicDefinitionId>22</CharacteristicDefinitionId>
      </PositionCharacteristicNominal>
      <DiameterCharacteristicNominal id="33"><CharacteristicDefinitionId>23</CharacteristicDefinitionId>
        <Name>D1</Name><TargetValue>20</TargetValue></DiameterCharacteristicNominal>
      <DiameterCharacteristicNominal id="34"><CharacteristicDefinitionId>24</CharacteristicDefinitionId>
        <Name>D2</Name></DiameterCharacteristicNominal>
      <AngleCharacteristicNominal id="35"><CharacteristicDefinitionId>25</CharacteristicDefinitionId>
        <Name>A1</Name><TargetValue>60</TargetValue></AngleCharacteristicNominal>
      <DiameterCharacteristicNominal id="36"><CharacteristicDefinitionId>26</CharacteristicDefinitionId>
        <Name>D3</Name><TargetValue>30</TargetValue></DiameterCharacteristicNominal>
      <SurfaceTextureCharacteristicNominal id="37"><CharacteristicDefinitionId>27</CharacteristicDefinitionId>
        <Name>Ra</Name></SurfaceTextureCharacteristicNominal>
    </CharacteristicNominals>
    <CharacteristicItems n="1">
      <PositionCharacteristicItem id="41"><Name>7</Name>
        <FeatureItemIds n="1"><Id>13</Id></FeatureItemIds>
        <CharacteristicNominalId>32</CharacteristicNominalId></PositionCharacteristicItem>
    </CharacteristicItems>
  </Characteristics>
</QIFDocument>
)";

class QifTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::path(::testing::TempDir()) /
        (std::string("qif_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Write(const std::string& text, const std::string& name = "part.qif") const {
    const fs::path path = folder_ / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << text;
    return path.string();
  }
  std::string ErrorOf(const std::string& text) const {
    const auto report = ReadQif(Write(text));
    return report.ok() ? "accepted" : std::string(report.status().message());
  }
  static std::string With(const std::string& from, const std::string& to) {
    std::string text = absl::StrReplaceAll(kQif, {{from, to}});
    EXPECT_NE(text, kQif) << from;
    return text;
  }

  fs::path folder_;
};

TEST_F(QifTest, EverythingIsReadOrListed) {
  const auto read = ReadQif(Write(kQif));
  ASSERT_TRUE(read.ok()) << read.status();
  const ToleranceReport& report = *read;
  EXPECT_EQ(report.standard, "QIF 3.0");
  EXPECT_EQ(report.file, "part.qif");
  ASSERT_THAT(report.read, SizeIs(5));
  EXPECT_EQ(static_cast<size_t>(report.entity_count),
            report.read.size() + report.untoleranced.size() + report.datums.size() +
                report.not_read.size());

  const Tolerance& flatness = report.read[0];
  EXPECT_EQ(flatness.kind, ToleranceKind::kFlatness);
  EXPECT_DOUBLE_EQ(flatness.zone_width_m, 0.2e-3);
  EXPECT_EQ(flatness.name, "Flatness.1");
  EXPECT_THAT(flatness.features, ElementsAre("plane top (feature 11, entities 501)"));
  // The file gives no geometry of the feature.
  EXPECT_THAT(flatness.faces, ElementsAre(1));
  EXPECT_EQ(report.nominal_faces.at(0).surface.kind, SurfaceKind::kFreeform);

  const Tolerance& position = report.read[1];
  EXPECT_DOUBLE_EQ(position.zone_width_m, 0.254e-3);  // 0.01 inch
  EXPECT_TRUE(position.diameter_zone);
  EXPECT_EQ(position.name, "7");
  EXPECT_THAT(position.datums, ElementsAre("A", "B(M)"));
  EXPECT_THAT(position.modifiers, ElementsAre("maximum material requirement"));
  EXPECT_THAT(position.features, ElementsAre("cylinder HOLE1 (feature 12, entities 561, 566)"));
  EXPECT_EQ(position.text, "position diameter 0.254 mm maximum material requirement | A | B(M)");

  const Tolerance& diameter = report.read[2];
  EXPECT_DOUBLE_EQ(diameter.nominal_m.value(), 0.02);
  EXPECT_DOUBLE_EQ(diameter.lower_m.value(), 0.0199);
  EXPECT_DOUBLE_EQ(diameter.upper_m.value(), 0.02005);
  EXPECT_NEAR(diameter.zone_width_m, 0.15e-3, 1e-12);
  EXPECT_EQ(diameter.text, "diameter 20 +0.05/-0.1 mm");

  EXPECT_NEAR(report.read[3].zone_width_m, 0.4e-3, 1e-12);
  EXPECT_FALSE(report.read[3].nominal_m.has_value());

  EXPECT_EQ(report.read[4].kind, ToleranceKind::kAngularSize);
  EXPECT_NEAR(report.read[4].zone_width_rad, std::numbers::pi / 180, 1e-12);
  EXPECT_EQ(report.read[4].zone_width_m, 0);

  ASSERT_THAT(report.untoleranced, SizeIs(1));
  EXPECT_DOUBLE_EQ(report.untoleranced[0].nominal_m.value(), 0.03);
  ASSERT_THAT(report.datums, SizeIs(2));
  EXPECT_THAT(report.datums[0].features, ElementsAre("plane top (feature 11, entities 501)"));
  ASSERT_THAT(report.not_read, SizeIs(2));
  EXPECT_THAT(report.not_read[0].name, AllOf(HasSubstr("Ra"), HasSubstr("37")));
  EXPECT_THAT(report.not_read[0].reason, HasSubstr("SurfaceTexture"));
  EXPECT_THAT(report.not_read[1].reason, HasSubstr("no characteristic refers to it"));
  EXPECT_THAT(report.notes[0], HasSubstr("not validated"));
}

TEST_F(QifTest, FaultsAreNamedWithLineAndElement) {
  const std::string before(kQif, std::string(kQif).find("<ToleranceValue>0.2<"));
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  EXPECT_THAT(ErrorOf(With("<ToleranceValue>0.2<", "<ToleranceValue>wide<")),
              AllOf(HasSubstr(absl::StrCat("part.qif:", line, ":")), HasSubstr("<ToleranceValue>"),
                    HasSubstr("wide")));
  EXPECT_THAT(ErrorOf(With("<ToleranceValue>0.2<", "<ToleranceValue>INF<")), HasSubstr("finite"));
  EXPECT_THAT(ErrorOf(With(R"(linearUnit="inch")", R"(linearUnit="parsec")")),
              HasSubstr("unit \"parsec\""));
  EXPECT_THAT(ErrorOf(With("<Id>11</Id>", "<Id>99</Id>")),
              AllOf(HasSubstr("feature nominal 99"), HasSubstr("not in the file")));
  EXPECT_THAT(ErrorOf(With(R"(id="12")", R"(id="11")")), HasSubstr("same id"));
  EXPECT_THAT(ErrorOf(With(R"(Definitions n="8")", R"(Definitions n="9")")),
              HasSubstr("attribute n is 9; it has 8 elements"));
  EXPECT_THAT(ErrorOf(With("<DefinedAsLimit>true<", "<DefinedAsLimit>perhaps<")),
              HasSubstr("DefinedAsLimit"));
  EXPECT_THAT(ErrorOf(With(R"(versionQIF="3.0.0")", R"(versionQIF="2.1.0")")),
              HasSubstr("versionQIF is \"2.1.0\""));
  EXPECT_THAT(ErrorOf(With("xsd/qif3", "xsd/qif2")), HasSubstr("namespace"));
  EXPECT_THAT(ErrorOf("<a/>"), HasSubstr("not a QIF file"));
  EXPECT_THAT(ErrorOf(""), HasSubstr("part.qif"));
  EXPECT_THAT(ErrorOf(std::string(kQif).substr(0, 2000)), HasSubstr("part.qif:"));
  EXPECT_EQ(ReadQif((folder_ / "none.qif").string()).status().code(), absl::StatusCode::kNotFound);
}

// If an element that may stand once stands twice, neither is taken.
TEST_F(QifTest, ElementsThatStandTwiceAreRefusedWithBothLines) {
  struct Case {
    std::string element;  // as it stands in kQif; its first tag names it
    std::string again;    // with another value
  };
  for (const auto& [element, again] : std::vector<Case>{
           {"<ToleranceValue>0.2</ToleranceValue>", "<ToleranceValue>2</ToleranceValue>"},
           {"<MaxValue>35.2</MaxValue>", "<MaxValue>36</MaxValue>"},
           {"<DefinedAsLimit>true</DefinedAsLimit>", "<DefinedAsLimit>false</DefinedAsLimit>"},
           {"<TargetValue>20</TargetValue>", "<TargetValue>21</TargetValue>"},
           {"<DatumLabel>A</DatumLabel>", "<DatumLabel>C</DatumLabel>"},
           {"<DatumReferenceFrameId>3</DatumReferenceFrameId>",
            "<DatumReferenceFrameId>4</DatumReferenceFrameId>"},
           {"<MaterialCondition>MAXIMUM</MaterialCondition>",
            "<MaterialCondition>LEAST</MaterialCondition>"},
           {"<CharacteristicDefinitionId>21</CharacteristicDefinitionId>",
            "<CharacteristicDefinitionId>28</CharacteristicDefinitionId>"},
           {"<UnitName>mm</UnitName>", "<UnitName>inch</UnitName>"},
           {"<Factor>0.001</Factor>", "<Factor>0.0254</Factor>"},
           {"<AngularUnit><SIUnitName>radian</SIUnitName><UnitName>degree</UnitName>",
            "<AngularUnit><UnitName>radian</UnitName></AngularUnit>"},
           {"<ZoneShape><DiametricalZone/></ZoneShape>", "<ZoneShape/>"},
           {"<PrecedenceEnum>PRIMARY</PrecedenceEnum>",
            "<PrecedenceEnum>TERTIARY</PrecedenceEnum>"}}) {
    ASSERT_EQ(ErrorOf(kQif), "accepted");
    const std::string name = element.substr(0, element.find('>') + 1);
    const std::string error = ErrorOf(With(element, again + "\n" + element));
    EXPECT_THAT(error, AllOf(HasSubstr("part.qif:"), HasSubstr(name), HasSubstr("twice"))) << name;
  }
  const std::string text = kQif;
  const std::string value = "<ToleranceValue>0.2</ToleranceValue>";
  const auto line =
      1 +
      std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(text.find(value)), '\n');
  EXPECT_THAT(ErrorOf(With(value, value + "\n" + value)),
              AllOf(HasSubstr(absl::StrCat("part.qif:", line + 1, ":")),
                    HasSubstr(absl::StrCat("the first is in line ", line))));
  EXPECT_THAT(ErrorOf(With("<LinearUnit><SIUnitName>meter</SIUnitName><UnitName>mm<",
                           "<LinearUnit><UnitName>inch</UnitName></LinearUnit><LinearUnit>"
                           "<SIUnitName>meter</SIUnitName><UnitName>mm<")),
              AllOf(HasSubstr("<LinearUnit>"), HasSubstr("twice in <PrimaryUnits>")));
}

TEST_F(QifTest, ValuesThatAreNoZonesAreListed) {
  const auto reasons = [&](const std::string& text) {
    const auto report = ReadQif(Write(text));
    EXPECT_TRUE(report.ok()) << report.status();
    std::string all;
    for (const UnreadTolerance& unread : report->not_read) all += unread.reason + "\n";
    return all;
  };
  EXPECT_THAT(reasons(With("<ToleranceValue>0.2<", "<ToleranceValue>0<")),
              HasSubstr("zone width is 0"));
  EXPECT_THAT(reasons(With("<MinValue>34.8<", "<MinValue>35.3<")), HasSubstr("not below"));
  EXPECT_THAT(reasons(With("<MinValue>34.8</MinValue>", "")), HasSubstr("one limit only"));
  EXPECT_THAT(reasons(With("<TargetValue>20</TargetValue>", "")), HasSubstr("no <TargetValue>"));
  EXPECT_THAT(reasons(With("<ToleranceValue>0.2</ToleranceValue>", "")),
              HasSubstr("no <ToleranceValue>"));
}

TEST_F(QifTest, EntitiesAreRefused) {
  // A billion laughs, a file of the machine, a DTD elsewhere.
  std::string bomb = "<?xml version=\"1.0\"?><!DOCTYPE QIFDocument [<!ENTITY e0 \"ha\">";
  for (int i = 1; i < 30; ++i) {
    absl::StrAppend(&bomb, "<!ENTITY e", i, " \"&e", i - 1, ";&e", i - 1, ";\">");
  }
  absl::StrAppend(&bomb, "]><QIFDocument>&e29;</QIFDocument>");
  EXPECT_THAT(ErrorOf(bomb), HasSubstr("DOCTYPE"));
  EXPECT_THAT(ErrorOf("<!DOCTYPE a [<!ENTITY x SYSTEM \"file:///etc/passwd\">]><a>&x;</a>"),
              HasSubstr("DOCTYPE"));
  EXPECT_THAT(ErrorOf("<!DOCTYPE a SYSTEM \"http://example.org/a.dtd\"><a/>"),
              HasSubstr("DOCTYPE"));
}

TEST_F(QifTest, DeepNestingIsRefused) {
  std::string open, close;
  for (int i = 0; i < 100000; ++i) {
    open += "<d>";
    close += "</d>";
  }
  EXPECT_THAT(ErrorOf(With("read past", open + close)), HasSubstr("nested more than"));
}

// One feature of many entities, or with a long name, to which many characteristics refer: the
// report on them must not grow as the product.
TEST_F(QifTest, ReferencesDoNotMultiplyWhatIsRead) {
  const auto document = [](const std::string& feature, int characteristics) {
    std::string text = absl::StrCat(
        R"(<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0">
  <FileUnits><PrimaryUnits><LinearUnit><UnitName>m</UnitName></LinearUnit></PrimaryUnits></FileUnits>
  <Features><FeatureNominals><PlaneFeatureNominal id="f">)",
        feature, R"(</PlaneFeatureNominal></FeatureNominals></Features><Characteristics>
  <CharacteristicDefinitions><FlatnessCharacteristicDefinition id="d"><ToleranceValue>1e-4</ToleranceValue>
  </FlatnessCharacteristicDefinition></CharacteristicDefinitions><CharacteristicNominals>)");
    for (int i = 0; i < characteristics; ++i) {
      absl::StrAppend(&text, "<FlatnessCharacteristicNominal id=\"n", i,
                      "\"><CharacteristicDefinitionId>d</CharacteristicDefinitionId>"
                      "<FeatureNominalIds><Id>f</Id></FeatureNominalIds>"
                      "</FlatnessCharacteristicNominal>\n");
    }
    return text + "</CharacteristicNominals></Characteristics></QIFDocument>";
  };
  std::string entities;
  for (int i = 0; i < 20'000; ++i) absl::StrAppend(&entities, "<Id>", 100'000 + i, "</Id>");
  entities = "<EntityInternalIds>" + entities + "</EntityInternalIds>";

  const auto one = ReadQif(Write(document(entities, 1)));
  ASSERT_TRUE(one.ok()) << one.status();
  EXPECT_THAT(one->read.at(0).features.at(0), HasSubstr("100015 and 19984 more)"));
  const std::string many = Write(document(entities, 20'000));
  EXPECT_THAT(WithinLimits({.cpu_time_s = 20, .memory_bytes = int64_t{512} << 20},
                           [&] { return std::string(ReadQif(many).status().message()); }),
              HasSubstr("refer to each other so often"));
  const std::string long_name =
      Write(document("<Name>" + std::string(4000, 'a') + "</Name>", 100'000));
  EXPECT_THAT(WithinLimits({.cpu_time_s = 20, .memory_bytes = int64_t{1} << 30},
                           [&] { return std::string(ReadQif(long_name).status().message()); }),
              HasSubstr("refer to each other so often"));
  // Much, but only as much as the file says.
  const std::string large = Write(document("<Name>top</Name>", 50'000));
  EXPECT_EQ(WithinLimits({.cpu_time_s = 20},
                         [&] {
                           const auto report = ReadQif(large);
                           return report.ok() ? absl::StrCat(report->read.size()) : "refused";
                         }),
            "50000");
}

// Cut and flipped bytes: an error or a report whose numbers are finite, never a crash.
TEST_F(QifTest, DamagedFilesDoNotCrash) {
  std::mt19937 random(11);
  const std::string good = kQif;
  std::uniform_int_distribution<size_t> where(0, good.size() - 1);
  std::uniform_int_distribution<int> what(32, 126);
  int refused = 0;
  for (int trial = 0; trial < 400; ++trial) {
    std::string text = good;
    if (trial % 4 == 0) {
      text.resize(where(random));
    } else {
      for (int k = 0; k < 1 + trial % 3; ++k) text[where(random)] = static_cast<char>(what(random));
    }
    const auto report = ReadQif(Write(text));
    if (!report.ok()) {
      EXPECT_THAT(std::string(report.status().message()), HasSubstr("part.qif"));
      ++refused;
      continue;
    }
    for (const Tolerance& tolerance : report->read) {
      EXPECT_TRUE(std::isfinite(tolerance.zone_width_m) && tolerance.zone_width_m >= 0);
    }
  }
  EXPECT_GT(refused, 200);
}

// --- units of QIF

constexpr char kDegreeUnit[] =
    "<AngularUnit><UnitName>degree</UnitName><UnitConversion><Factor>0.017453293</Factor>"
    "</UnitConversion></AngularUnit>";

class QifUnitsTest : public QifTest {
 protected:
  static std::string File(const std::string& linear, const std::string& angular) {
    std::string text = kQif;
    const size_t begin = text.find("<LinearUnit>"), end = text.find("</PrimaryUnits>");
    return text.replace(begin, end - begin, angular + linear);
  }
  absl::StatusOr<ToleranceReport> Read(const std::string& linear, const std::string& angular,
                                       const std::string& stated = "") const {
    return ReadQif(Write(File(linear, angular)), "", stated);
  }
};

const Tolerance& WithId(const ToleranceReport& report, const std::string& id) {
  for (const Tolerance& tolerance : report.read) {
    if (tolerance.id == id) return tolerance;
  }
  ADD_FAILURE() << "no tolerance " << id;
  return report.read.front();
}

TEST_F(QifUnitsTest, AUnitIsKnownByItsConversionOrByItsName) {
  const auto linear = [](const std::string& name, const std::string& factor = "") {
    return "<LinearUnit><UnitName>" + name + "</UnitName>" +
           (factor.empty() ? ""
                           : "<UnitConversion><Factor>" + factor + "</Factor></UnitConversion>") +
           "</LinearUnit>";
  };
  const std::vector<std::pair<std::string, double>> lengths = {
      {linear("mm"), 0.2e-3},
      {linear("MM"), 0.2e-3},
      {linear("millimeter"), 0.2e-3},
      {linear("Millimetre"), 0.2e-3},
      {linear("cm"), 0.2e-2},
      {linear("um"), 0.2e-6},
      {linear("\u00b5m"), 0.2e-6},
      {linear("m"), 0.2},
      {linear("meter"), 0.2},
      {linear("inch"), 0.2 * 0.0254},
      {linear("in"), 0.2 * 0.0254},
      {linear("foot"), 0.2 * 0.3048},
      {linear("mm", "0.001"), 0.2e-3},
      {linear("tenth", "0.0001"), 0.2e-4},
      {"<LinearUnit><SIUnitName>meter</SIUnitName><UnitName>mm</UnitName></LinearUnit>", 0.2e-3},
      // Units of the PMI come before the others, in both orders.
      {linear("mm") + "<PMILinearUnit><UnitName>in</UnitName></PMILinearUnit>", 0.2 * 0.0254},
      {"<PMILinearUnit><UnitName>in</UnitName></PMILinearUnit>" + linear("mm"), 0.2 * 0.0254},
  };
  for (const auto& [unit, width_m] : lengths) {
    const auto report = Read(unit, kDegreeUnit);
    ASSERT_TRUE(report.ok()) << unit << ": " << report.status();
    EXPECT_NEAR(WithId(*report, "31").zone_width_m, width_m, 1e-12 * width_m) << unit;
    EXPECT_NEAR(WithId(*report, "32").zone_width_m, 0.01 * 0.0254, 1e-15) << unit;
  }
  for (const auto& [name, radians] : {std::pair{"degree", std::numbers::pi / 180},
                                      {"Degrees", std::numbers::pi / 180},
                                      {"deg", std::numbers::pi / 180},
                                      {"radian", 1.0},
                                      {"gon", std::numbers::pi / 200}}) {
    const auto report = Read(
        linear("mm"), absl::StrCat("<AngularUnit><UnitName>", name, "</UnitName></AngularUnit>"));
    ASSERT_TRUE(report.ok()) << name << ": " << report.status();
    EXPECT_NEAR(WithId(*report, "35").zone_width_rad, radians, 1e-12) << name;
    EXPECT_NEAR(*WithId(*report, "35").nominal_rad, 60 * radians, 1e-10) << name;
  }
}

TEST_F(QifUnitsTest, AUnitThatIsNotKnownIsRefusedUnlessItIsStated) {
  for (const char* unit : {"", "<LinearUnit><UnitName>furlong</UnitName></LinearUnit>",
                           "<LinearUnit><UnitName>Mm</UnitName></LinearUnit>"}) {
    const auto refused = Read(unit, kDegreeUnit);
    EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument) << unit;
    EXPECT_THAT(std::string(refused.status().message()),
                AllOf(HasSubstr("part.qif:"), HasSubstr("<ToleranceValue>"), HasSubstr("--unit"),
                      HasSubstr("tolerances.unit"), HasSubstr("--tolerances-unit")))
        << unit;
    const auto stated = Read(unit, kDegreeUnit, "mm");
    ASSERT_TRUE(stated.ok()) << unit << ": " << stated.status();
    EXPECT_DOUBLE_EQ(WithId(*stated, "31").zone_width_m, 0.2e-3);
    // A value with a unit of its own keeps it.
    EXPECT_NEAR(WithId(*stated, "32").zone_width_m, 0.01 * 0.0254, 1e-15);
  }
  const std::string mm = "<LinearUnit><UnitName>mm</UnitName></LinearUnit>";
  for (const char* unit : {"", "<AngularUnit><UnitName>point</UnitName></AngularUnit>"}) {
    EXPECT_THAT(std::string(Read(mm, unit).status().message()),
                AllOf(HasSubstr("part.qif:"), HasSubstr("Value>"), HasSubstr("<FileUnits>")))
        << unit;
  }
  // An unknown unit that no value has is no obstacle.
  EXPECT_TRUE(Read(mm + "<PMIAreaUnit><UnitName>acre</UnitName></PMIAreaUnit>", kDegreeUnit).ok());
}

TEST_F(QifUnitsTest, ContradictionsAreNamed) {
  const auto error = [&](const std::string& linear, const std::string& stated = "") {
    return std::string(Read(linear, kDegreeUnit, stated).status().message());
  };
  const std::string mm = "<LinearUnit><UnitName>mm</UnitName></LinearUnit>";
  EXPECT_THAT(error("<LinearUnit><UnitName>mm</UnitName><UnitConversion><Factor>0.0254</Factor>"
                    "</UnitConversion></LinearUnit>"),
              AllOf(HasSubstr("part.qif:"), HasSubstr("0.0254 contradicts the UnitName mm")));
  EXPECT_THAT(error("<LinearUnit><SIUnitName>mm</SIUnitName><UnitName>mm</UnitName></LinearUnit>"),
              HasSubstr("SIUnitName is \"mm\"; must be meter"));
  EXPECT_THAT(error("<LinearUnit/>"), HasSubstr("<UnitName> is missing"));
  EXPECT_THAT(error("<LinearUnit><UnitName>x</UnitName><UnitConversion><Factor>0x1</Factor>"
                    "</UnitConversion></LinearUnit>"),
              HasSubstr("<Factor> is \"0x1\""));
  EXPECT_THAT(error("<LinearUnit><UnitName>x</UnitName><UnitConversion><Factor>1</Factor><Offset>3"
                    "</Offset></UnitConversion></LinearUnit>"),
              HasSubstr("<Offset>"));
  EXPECT_THAT(error(mm, "mm"), AllOf(HasSubstr("states its unit, mm"), HasSubstr("--unit"),
                                     HasSubstr("tolerances.unit")));
  EXPECT_THAT(error("", "cubit"), HasSubstr("the length unit given for it is \"cubit\""));
}

// Bytes before and behind the document.
TEST_F(QifUnitsTest, AByteOrderMarkIsReadAndBytesLeftOverAreAnError) {
  EXPECT_TRUE(ReadQif(Write(absl::StrCat("\xEF\xBB\xBF", kQif))).ok());
  EXPECT_TRUE(ReadQif(Write(absl::StrCat(kQif, "\n  <!-- end -->\n"))).ok());
  for (const std::string& tail : {std::string("x"), std::string("<QIFDocument/>"),
                                  std::string("\x1a"), std::string(1, '\0')}) {
    EXPECT_THAT(ErrorOf(kQif + tail), HasSubstr("part.qif:")) << tail;
  }
}

// A schema of this test's own that knows fewer elements than QIF has.
TEST_F(QifTest, SchemaFolderValidates) {
  const std::string head =
      R"(<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" xmlns="http://qifstandards.org/xsd/qif3"
      targetNamespace="http://qifstandards.org/xsd/qif3" elementFormDefault="qualified">)";
  Write(head + R"(<xs:include schemaLocation="../QIFLibrary/Units.xsd"/>
    <xs:element name="QIFDocument"><xs:complexType><xs:sequence>
      <xs:element name="FileUnits" type="UnitsType" minOccurs="0"/></xs:sequence>
      <xs:attribute name="versionQIF"/><xs:attribute name="idMax" type="xs:unsignedInt"/>
    </xs:complexType></xs:element></xs:schema>)",
        "schema/QIFApplications/QIFDocument.xsd");
  Write(head + R"(<xs:complexType name="UnitsType"><xs:sequence>
      <xs:element name="PrimaryUnits" minOccurs="0"/></xs:sequence></xs:complexType></xs:schema>)",
        "schema/QIFLibrary/Units.xsd");
  const std::string schema = (folder_ / "schema").string();
  const auto document = [](const std::string& inner, const std::string& id_max) {
    return "<QIFDocument xmlns=\"http://qifstandards.org/xsd/qif3\" versionQIF=\"3.0.0\" idMax=\"" +
           id_max + "\">\n" + inner + "</QIFDocument>";
  };
  const auto good = ReadQif(Write(document("<FileUnits/>", "3")), schema);
  ASSERT_TRUE(good.ok()) << good.status();
  EXPECT_EQ(good->entity_count, 0);
  EXPECT_THAT(good->notes[0], HasSubstr("validated against the QIF schema"));
  EXPECT_THAT(std::string(ReadQif(Write(document("<Nonsense/>", "3")), schema).status().message()),
              AllOf(HasSubstr("part.qif:2:"), HasSubstr("Nonsense")));
  EXPECT_THAT(std::string(ReadQif(Write(document("", "many")), schema).status().message()),
              HasSubstr("many"));
  // Without the schema nothing is known against it.
  EXPECT_TRUE(ReadQif(Write(document("<Nonsense/>", "3"))).ok());
  // No schema there, and one that leads out of its folder.
  EXPECT_EQ(ReadQif(Write(kQif), folder_.string()).status().code(), absl::StatusCode::kNotFound);
  Write(head + R"(<xs:include schemaLocation="../../outside.xsd"/></xs:schema>)",
        "schema/QIFApplications/QIFDocument.xsd");
  Write(head + "</xs:schema>", "outside.xsd");
  EXPECT_THAT(std::string(ReadQif(Write(kQif), schema).status().message()),
              HasSubstr("outside its folder"));
}

}  // namespace
}  // namespace sightline
