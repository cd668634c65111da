// SPDX-License-Identifier: Apache-2.0
// Tests which entities of a STEP file are the part, its unit, and refusals, with files that
// OpenCASCADE writes and with hand-written ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <tiny_gltf.h>
#include <unistd.h>

#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Poly_Triangulation.hxx>
#include <STEPControl_Writer.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shell.hxx>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <gp_Pln.hxx>
#include <regex>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_replace.h"
#include "core/text/step_length_unit.h"
#include "planner_client/part_files/step_program.h"
#include "tools/step_import/glb_writer.h"
#include "tools/step_import/model/crash_report.h"
#include "tools/step_import/model/exchange_structure.h"
#include "tools/step_import/shape_mesh.h"
#include "tools/step_import/step_reader.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr char kEndOfData[] = "ENDSEC;\nEND-ISO-10303-21;";

StepModel Read(const std::string& text, const StepReadOptions& options = {}) {
  return ReadStep(CheckedStepText("test.stp", text), options);
}

// The reason why it is refused; empty if it is not.
std::string Refusal(const std::string& text, const StepReadOptions& options = {}) {
  try {
    Read(text, options);
    return "";
  } catch (const StepInputError& error) {
    return error.what();
  }
}

MeshHealth HealthOf(const StepBody& body) {
  return CheckMesh(body.shape.IsNull() ? body.tessellation : MeshShape(body.shape, {}));
}

// OpenCASCADE's file of a box of 50 x 30 x 20 mm, a product of its own for each of two squares.
class StepReadingTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    Message::DefaultMessenger()->ChangePrinters().Clear();
    const std::string path =
        (fs::temp_directory_path() / ("step_reading_" + std::to_string(getpid()) + ".stp"))
            .string();
    STEPControl_Writer writer;
    ASSERT_EQ(writer.Transfer(BRepPrimAPI_MakeBox(50, 30, 20).Shape(), STEPControl_AsIs),
              IFSelect_RetDone);
    ASSERT_EQ(writer.Write(path.c_str()), IFSelect_RetDone);
    box_ = Text(path);
    for (const double height_mm : {60.0, 80.0}) {
      TopoDS_Shell shell;
      BRep_Builder builder;
      builder.MakeShell(shell);
      const gp_Pln plane(gp_Pnt(0, 0, height_mm), gp_Dir(0, 0, 1));
      builder.Add(shell, BRepBuilderAPI_MakeFace(plane, 0, 10, 0, 10).Face());
      ASSERT_EQ(writer.Transfer(shell, STEPControl_ShellBasedSurfaceModel), IFSelect_RetDone);
    }
    ASSERT_EQ(writer.Write(path.c_str()), IFSelect_RetDone);
    box_and_squares_ = Text(path);
    fs::remove(path);
  }

  static std::string Text(const std::string& path) {
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }

  static std::string box_, box_and_squares_;
};
std::string StepReadingTest::box_;
std::string StepReadingTest::box_and_squares_;

// --- Construction geometry -----------------------------------------------------------------------

// A simple instance: "#12", and its attributes as they are written.
struct Found {
  std::string id, values;
};
std::vector<Found> FindAll(const std::string& text, const std::string& type) {
  std::vector<Found> found;
  const std::regex entity("(#\\d+) *= *" + type + " *\\(([^;]*)\\) *;");
  for (std::sregex_iterator it(text.begin(), text.end(), entity), end; it != end; ++it) {
    found.push_back({(*it)[1], (*it)[2]});
  }
  return found;
}

// Binds the two squares to the box's product in the given way instead of products of their own.
// In `entities`: $ITEM a square's surface model, $CONTEXT its context, $BOX the representation of
// the box, $SHAPE its PRODUCT_DEFINITION_SHAPE; $1 to $9 numbers for the square's own use.
std::string BindSquares(std::string text, const std::string& entities) {
  const auto uses = FindAll(text, "SHAPE_DEFINITION_REPRESENTATION");
  const auto surfaces = FindAll(text, "MANIFOLD_SURFACE_SHAPE_REPRESENTATION");
  const auto models = FindAll(text, "SHELL_BASED_SURFACE_MODEL");
  EXPECT_THAT(uses, SizeIs(3));
  EXPECT_THAT(surfaces, SizeIs(2));
  EXPECT_THAT(models, SizeIs(2));
  const auto shape_and_box = uses.at(0).values;  // "#4,#10"
  const size_t comma = shape_and_box.find(',');
  std::string added;
  const std::vector<std::string> names = {"Extract.1", "Join.2"};
  for (size_t i = 0; i < 2; ++i) {
    const std::string context = surfaces[i].values.substr(surfaces[i].values.rfind('#'));
    std::vector<std::pair<std::string, std::string>> words = {
        {"$ITEM", models[i].id},
        {"$CONTEXT", context},
        {"$SHAPE", shape_and_box.substr(0, comma)},
        {"$BOX", shape_and_box.substr(comma + 1)}};
    for (int k = 1; k < 10; ++k) {
      words.emplace_back("$" + std::to_string(k),
                         "#" + std::to_string(900000 + 10 * static_cast<int>(i) + k));
    }
    added += absl::StrReplaceAll(entities, words);
    text =
        std::regex_replace(text, std::regex(models[i].id + " *= *SHELL_BASED_SURFACE_MODEL\\(''"),
                           models[i].id + "=SHELL_BASED_SURFACE_MODEL('" + names[i] + "'");
    // No product uses them any more.
    text = std::regex_replace(text, std::regex(uses[i + 1].id + " *= *[^;]*;"), "");
    text = std::regex_replace(text, std::regex(surfaces[i].id + " *= *[^;]*;"), "");
  }
  text.insert(text.rfind(kEndOfData), added);
  return text;
}

struct Binding {
  const char* name;
  const char* entities;
};
constexpr char kByRelationship[] =
    "$1=CONSTRUCTIVE_GEOMETRY_REPRESENTATION('supplemental geometry',($ITEM),$CONTEXT);\n"
    "$2=CONSTRUCTIVE_GEOMETRY_REPRESENTATION_RELATIONSHIP('','',$BOX,$1);\n";
constexpr char kByAspect[] =
    "$3=SHAPE_ASPECT('','',$SHAPE,.F.);\n$4=PROPERTY_DEFINITION('','',$3);\n"
    "$5=SHAPE_REPRESENTATION('',($ITEM),$CONTEXT);\n"
    "$6=SHAPE_DEFINITION_REPRESENTATION($4,$5);\n";
constexpr char kByName[] =
    "$1=MANIFOLD_SURFACE_SHAPE_REPRESENTATION('Supplemental Geometry',($ITEM),$CONTEXT);\n"
    "$2=SHAPE_REPRESENTATION_RELATIONSHIP('','',$BOX,$1);\n";
// CATIA writes extracts, joins and splits so.
constexpr char kBesideSolid[] =
    "$1=MANIFOLD_SURFACE_SHAPE_REPRESENTATION('',($ITEM),$CONTEXT);\n"
    "$2=SHAPE_REPRESENTATION_RELATIONSHIP('','',$BOX,$1);\n";
constexpr char kBesideSolidWithAspect[] =
    "$1=MANIFOLD_SURFACE_SHAPE_REPRESENTATION('',($ITEM),$CONTEXT);\n"
    "$2=SHAPE_REPRESENTATION_RELATIONSHIP('','',$BOX,$1);\n"
    "$3=SHAPE_ASPECT('','',$SHAPE,.F.);\n$4=PROPERTY_DEFINITION('','',$3);\n"
    "$5=SHAPE_REPRESENTATION('',($ITEM),$CONTEXT);\n"
    "$6=SHAPE_DEFINITION_REPRESENTATION($4,$5);\n";

TEST_F(StepReadingTest, OnlyTheProductsShapeIsThePart) {
  const std::string both = std::string(kByRelationship) + kByAspect;
  for (const auto& [name, entities] :
       {Binding{"constructive geometry", kByRelationship}, Binding{"shape aspects", kByAspect},
        Binding{"both", both.c_str()}, Binding{"by name", kByName},
        Binding{"beside a solid", kBesideSolid},
        Binding{"beside a solid, with aspects", kBesideSolidWithAspect}}) {
    const std::string text = BindSquares(box_and_squares_, entities);
    const StepModel model = Read(text);
    ASSERT_THAT(model.bodies, SizeIs(1)) << name;
    EXPECT_TRUE(HealthOf(model.bodies[0]).watertight()) << name;
    EXPECT_NEAR(HealthOf(model.bodies[0]).area_mm2, 6200, 1e-9) << name;
    EXPECT_THAT(model.remarks, ElementsAre(AllOf(HasSubstr("\"Extract.1\", \"Join.2\""),
                                                 HasSubstr("--construction-geometry"))))
        << name;
    StepReadOptions all;
    all.construction_geometry = true;
    const StepModel taken = Read(text, all);
    ASSERT_THAT(taken.bodies, SizeIs(3)) << name;
    EXPECT_THAT(taken.remarks, IsEmpty()) << name;
    for (size_t i = 1; i < 3; ++i) {
      EXPECT_NEAR(HealthOf(taken.bodies[i]).area_mm2, 100, 1e-9) << name;
    }
  }
}

TEST_F(StepReadingTest, SurfacesOfAProductWithoutSolidAreThePart) {
  const StepModel model = Read(box_and_squares_);
  EXPECT_THAT(model.bodies, SizeIs(3));
  EXPECT_THAT(model.remarks, IsEmpty());
}

TEST_F(StepReadingTest, ASheetThatRepeatsFacesOfASolidIsNotMeshedTwice) {
  const std::string shells =
      "#900001=OPEN_SHELL('',($FACES));\n"
      "#900002=SHELL_BASED_SURFACE_MODEL('Skin',(#900001));\n"
      "#900003=MANIFOLD_SURFACE_SHAPE_REPRESENTATION('',(#900002),$CONTEXT);\n"
      "#900004=SHAPE_REPRESENTATION_RELATIONSHIP('','',$BOX,#900003);\n";
  const auto use = FindAll(box_, "SHAPE_DEFINITION_REPRESENTATION").at(0).values;
  const auto solid = FindAll(box_, "ADVANCED_BREP_SHAPE_REPRESENTATION").at(0).values;
  const auto faces = FindAll(box_, "ADVANCED_FACE");
  ASSERT_THAT(faces, SizeIs(6));
  for (const std::string& shared : {faces[2].id, faces[0].id + "," + faces[4].id}) {
    std::string text = box_;
    text.insert(text.rfind(kEndOfData),
                absl::StrReplaceAll(shells, {{"$FACES", shared},
                                             {"$CONTEXT", solid.substr(solid.rfind('#'))},
                                             {"$BOX", use.substr(use.find(',') + 1)}}));
    for (const bool construction_geometry : {false, true}) {
      StepReadOptions options;
      options.construction_geometry = construction_geometry;
      const StepModel model = Read(text, options);
      ASSERT_THAT(model.bodies, SizeIs(1));
      EXPECT_NEAR(HealthOf(model.bodies[0]).area_mm2, 6200, 1e-9);
      EXPECT_THAT(model.remarks, IsEmpty());
    }
  }
}

// --- Length unit ---------------------------------------------------------------------------------

TEST_F(StepReadingTest, AUnitThatIsNotStatedIsAskedFor) {
  const std::string no_units = std::regex_replace(
      box_, std::regex("\\( *GEOMETRIC_REPRESENTATION_CONTEXT\\(3\\)\\s*GLOBAL_UNCERTAINTY[^;]*;"),
      "(GEOMETRIC_REPRESENTATION_CONTEXT(3)REPRESENTATION_CONTEXT('',''));");
  std::smatch length;
  ASSERT_TRUE(std::regex_search(box_, length, std::regex("(#\\d+) *= *\\( *LENGTH_UNIT\\(\\)")));
  const std::string id = length[1];
  const std::string no_length =
      std::regex_replace(box_, std::regex("GLOBAL_UNIT_ASSIGNED_CONTEXT\\s*\\(\\(" + id + ","),
                         "GLOBAL_UNIT_ASSIGNED_CONTEXT((");
  // The planning service asks for the unit by a pass over the text, and must agree.
  const auto states_none = [](const std::string& text) {
    StepLengthUnitScan scan;
    scan.Add(text);
    return scan.StatesNone();
  };
  EXPECT_FALSE(states_none(box_));
  EXPECT_FALSE(states_none(box_and_squares_));
  for (const std::string& text : {no_units, no_length}) {
    ASSERT_NE(text, box_);
    EXPECT_TRUE(states_none(text));
    EXPECT_THAT(Refusal(text), AllOf(HasSubstr("test.stp: part.unit"), HasSubstr("--unit")));
    for (const auto& [unit, millimetres] :
         {std::pair("m", 1e3), std::pair("cm", 10.0), std::pair("mm", 1.0), std::pair("um", 1e-3),
          std::pair("inch", 25.4), std::pair("in", 25.4)}) {
      StepReadOptions options;
      options.unit = unit;
      const StepModel model = Read(text, options);
      const auto& positions = MeshShape(model.bodies.at(0).shape, {}).positions_mm;
      double largest_mm = 0;
      for (const auto& p : positions) largest_mm = std::max(largest_mm, p[0]);
      EXPECT_NEAR(largest_mm, 50 * millimetres, 1e-9 * 50 * millimetres) << unit;
    }
    StepReadOptions unknown;
    unknown.unit = "furlong";
    EXPECT_THAT(Refusal(text, unknown), HasSubstr("furlong"));
  }
  StepReadOptions second;
  second.unit = "mm";
  EXPECT_THAT(Refusal(box_, second),
              AllOf(HasSubstr("says its unit itself"), HasSubstr("millimetre")));
}

// --- The exchange structure ----------------------------------------------------------------------

TEST_F(StepReadingTest, BytesBehindTheEndMarkAreAnErrorUnlessTheySayNothing) {
  const std::string blank(5000, ' ');
  for (const std::string& end :
       {std::string(), std::string("\r\n"), blank, std::string(9000, '\n'), std::string(3, '\0'),
        std::string("\x1a"), std::string("\nSIGNATURE;\nQUJD\nENDSEC;\n")}) {
    EXPECT_EQ(Refusal(box_ + end), "");
  }
  EXPECT_EQ(Refusal("\xEF\xBB\xBF" + box_), "");
  for (const std::string& end : {std::string("x"), "\n#5=FOO();\n" + blank, box_}) {
    EXPECT_THAT(Refusal(box_ + end), HasSubstr("behind its end mark"));
  }
}

TEST_F(StepReadingTest, ATruncatedFileIsRefused) {
  const std::string whole = box_.substr(0, box_.find("END-ISO"));
  EXPECT_THAT(Refusal(whole), HasSubstr("truncated"));
  EXPECT_THAT(Refusal("solid x"), HasSubstr("not a STEP file"));
  // The mark in a name is none.
  const std::string named =
      std::regex_replace(box_, std::regex("PRODUCT\\('"), "PRODUCT('END-ISO-10303-21; ");
  ASSERT_NE(named, box_);
  EXPECT_EQ(Refusal(named), "");
}

// --- Tessellated geometry ------------------------------------------------------------------------

// A tetrahedron with legs of 10 along the axes.
std::string Tessellated(const std::string& face, const std::string& more = "") {
  return "ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF'"
         "));\nENDSEC;\nDATA;\n"
         "#3=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.CENTI.,.METRE.));\n"
         "#5=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#3))"
         "REPRESENTATION_CONTEXT('',''));\n"
         "#6=COORDINATES_LIST('',5,((9.,9.,9.),(0.,0.,0.),(1.,0.,0.),(0.,1.,0.),(0.,0.,1.)));\n"
         "#7=" +
         face +
         ";\n#8=TESSELLATED_SOLID('T',(#7),$);\n"
         "#9=APPLICATION_CONTEXT('managed model based 3d engineering');\n"
         "#11=PRODUCT_CONTEXT('',#9,'mechanical');\n"
         "#12=PRODUCT_DEFINITION_CONTEXT('part definition',#9,'design');\n"
         "#13=PRODUCT('L','L','',(#11));\n#14=PRODUCT_DEFINITION_FORMATION('','',#13);\n"
         "#15=PRODUCT_DEFINITION('design','',#14,#12);\n"
         "#16=PRODUCT_DEFINITION_SHAPE('','',#15);\n"
         "#17=TESSELLATED_SHAPE_REPRESENTATION('L',(#8),#5);\n"
         "#18=SHAPE_DEFINITION_REPRESENTATION(#16,#17);\n" +
         more + kEndOfData;
}

TEST_F(StepReadingTest, TessellatedSolidsAreReadAsTriangles) {
  for (const char* face :
       {"TRIANGULATED_FACE('',#6,4,(),$,(2,3,4,5),((1,3,2),(1,2,4),(1,4,3),(2,3,4)))",
        "TRIANGULATED_FACE('',#6,5,(),$,(),((2,4,3),(2,3,5),(2,5,4),(3,4,5)))",
        "COMPLEX_TRIANGULATED_FACE('',#6,4,(),$,(2,3,4,5),((1,2,4,3),(1,3,2)),((1,4,3)))",
        "COMPLEX_TRIANGULATED_FACE('',#6,4,(),$,(2,3,4,5),((2,3,4)),((1,3,2,4,3)))"}) {
    const StepModel model = Read(Tessellated(face));
    ASSERT_THAT(model.bodies, SizeIs(1)) << face;
    EXPECT_EQ(model.bodies[0].name, "T");
    const MeshHealth health = HealthOf(model.bodies[0]);
    EXPECT_TRUE(health.watertight()) << face;
    EXPECT_NEAR(health.volume_mm3, 1000.0 / 6, 1e-9) << face;
  }
  const std::string good =
      "TRIANGULATED_FACE('',#6,4,(),$,(2,3,4,5),((1,3,2),(1,2,4),(1,4,3),(2,3,4)))";
  EXPECT_THAT(Refusal(absl::StrReplaceAll(Tessellated(good), {{"(2,3,4))", "(2,3,9))"}})),
              AllOf(HasSubstr("#7"), HasSubstr("index")));
  EXPECT_THAT(Refusal(absl::StrReplaceAll(Tessellated(good), {{"(0.,0.,1.)", "(0.,1.)"}})),
              AllOf(HasSubstr("#6"), HasSubstr("2 coordinates")));
  EXPECT_THAT(Refusal(Tessellated("CUBIC_BEZIER_TRIANGULATED_FACE('',#6,4,(),$,(),())")),
              AllOf(HasSubstr("#7"), HasSubstr("not read")));
  EXPECT_THAT(
      Refusal(Tessellated(good, "#20=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#15,#15,$);\n")),
      AllOf(HasSubstr("#8"), HasSubstr("assembly")));
  // Without a length unit.
  const std::string unitless =
      absl::StrReplaceAll(Tessellated(good), {{"GLOBAL_UNIT_ASSIGNED_CONTEXT((#3))", ""}});
  EXPECT_THAT(Refusal(unitless), HasSubstr("part.unit is missing"));
  StepReadOptions millimetres;
  millimetres.unit = "mm";
  EXPECT_NEAR(HealthOf(Read(unitless, millimetres).bodies.at(0)).volume_mm3, 1.0 / 6, 1e-12);
  EXPECT_THAT(Refusal(Tessellated(good), millimetres), HasSubstr("says its unit itself"));
}

TEST_F(StepReadingTest, ATessellatedSolidOfAShapeAspectIsStillTheProducts) {
  const std::string face =
      "TRIANGULATED_FACE('',#6,4,(),$,(2,3,4,5),((1,3,2),(1,2,4),(1,4,3),(2,3,4)))";
  const std::string aspect =
      "#20=SHAPE_ASPECT('','',#16,.F.);\n#21=PROPERTY_DEFINITION('','',#20);\n"
      "#10=SHAPE_REPRESENTATION('',(#8),#5);\n#22=SHAPE_DEFINITION_REPRESENTATION(#21,#10);\n";
  const std::string both = Tessellated(face, aspect);
  const StepModel model = Read(both);
  ASSERT_THAT(model.bodies, SizeIs(1));
  EXPECT_NEAR(HealthOf(model.bodies[0]).volume_mm3, 1000.0 / 6, 1e-9);
  EXPECT_THAT(model.remarks, IsEmpty());
  const std::string aspect_only = absl::StrReplaceAll(
      both, {{"TESSELLATED_SHAPE_REPRESENTATION('L',(#8)", "SHAPE_REPRESENTATION('L',(#6)"}});
  EXPECT_THAT(Refusal(aspect_only),
              AllOf(HasSubstr("\"T\""), HasSubstr("in the shape of no product")));
}

TEST_F(StepReadingTest, AFileWithoutSurfacesSaysWhatItHolds) {
  const std::string text = absl::StrReplaceAll(
      Tessellated("TRIANGULATED_FACE('',#6,4,(),$,(),((2,3,4)))"),
      {{"TESSELLATED_SHAPE_REPRESENTATION('L',(#8)", "SHAPE_REPRESENTATION('L',(#6)"}});
  EXPECT_THAT(Refusal(text),
              AllOf(HasSubstr("no solid and no surface"), HasSubstr("COORDINATES_LIST")));
}

// --- Area ----------------------------------------------------------------------------------------

// The triangles of a face have its area, or the face is named.
TEST_F(StepReadingTest, FacesWhoseTrianglesHaveAnotherAreaAreNamed) {
  const std::vector<TopoDS_Shape> shapes = {BRepPrimAPI_MakeBox(20, 30, 40).Shape(),
                                            BRepPrimAPI_MakeCylinder(0.3, 50).Shape(),
                                            BRepPrimAPI_MakeSphere(100).Shape()};
  for (const TopoDS_Shape& shape : shapes) {
    for (const double chord_mm : {0.01, 0.05}) {
      const MeshingOptions options{.chord_tolerance_mm = chord_mm};
      MeshShape(shape, options);
      EXPECT_THAT(FacesOfOtherArea(shape, options), testing::IsEmpty());
    }
  }
  // Half of the third face is lost.
  TopExp_Explorer faces(shapes[0], TopAbs_FACE);
  faces.Next();
  faces.Next();
  const TopoDS_Face face = TopoDS::Face(faces.Current());
  TopLoc_Location location;
  const Handle(Poly_Triangulation) whole = BRep_Tool::Triangulation(face, location);
  ASSERT_EQ(whole->NbTriangles(), 2);
  Handle(Poly_Triangulation) half = new Poly_Triangulation(whole->NbNodes(), 1, false);
  for (int i = 1; i <= whole->NbNodes(); ++i) half->SetNode(i, whole->Node(i));
  half->SetTriangle(1, whole->Triangle(1));
  BRep_Builder().UpdateFace(face, half);
  EXPECT_THAT(FacesOfOtherArea(shapes[0], {}),
              testing::ElementsAre(testing::HasSubstr("face 3 of the body with a corner at (")));
}

// --- Far from the origin -------------------------------------------------------------------------

TEST_F(StepReadingTest, APartFarFromTheOriginKeepsItsShape) {
  for (const double far_mm : {0.0, 1900.0, 4e5}) {
    const TopoDS_Shape box = BRepPrimAPI_MakeBox(gp_Pnt(far_mm, -far_mm, 7), 20.1, 30.2, 40.3);
    const ShapeMesh mesh = MeshShape(box, {});
    const std::string path =
        (fs::temp_directory_path() / ("far_" + std::to_string(getpid()) + ".glb")).string();
    WriteGlb({mesh}, {}, path);
    tinygltf::Model model;
    tinygltf::TinyGLTF loader;
    std::string error, warning;
    ASSERT_TRUE(loader.LoadBinaryFromFile(&model, &error, &warning, path)) << error;
    fs::remove(path);
    const auto& translation = model.nodes.at(0).translation;
    const auto& accessor = model.accessors.at(0);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double origin_m = translation.empty() ? 0 : translation.at(axis);
      const std::array<double, 3> low_mm = {far_mm, -far_mm, 7}, size_mm = {20.1, 30.2, 40.3};
      EXPECT_NEAR(origin_m + accessor.minValues.at(axis), 1e-3 * low_mm[axis], 2e-7);
      EXPECT_NEAR(origin_m + accessor.maxValues.at(axis), 1e-3 * (low_mm[axis] + size_mm[axis]),
                  2e-7);
    }
  }
}

// --- Damage --------------------------------------------------------------------------------------

TEST_F(StepReadingTest, APointWithTwoCoordinatesIsRefusedOrOfNoConsequence) {
  const std::regex triple(
      "(CARTESIAN_POINT|DIRECTION)\\(('[^']*'),\\(([^,()]+),([^,()]+),([^,()]+)\\)");
  int refused = 0;
  for (std::sregex_iterator it(box_.begin(), box_.end(), triple), end; it != end; ++it) {
    const std::smatch& match = *it;
    std::string text = box_;
    text.replace(
        static_cast<size_t>(match.position()), static_cast<size_t>(match.length()),
        match[1].str() + "(" + match[2].str() + ",(" + match[3].str() + "," + match[4].str() + ")");
    const std::string refusal = Refusal(text);
    if (refusal.empty()) {
      EXPECT_NEAR(HealthOf(Read(text).bodies.at(0)).volume_mm3, 30000, 1e-6);
    } else {
      EXPECT_THAT(refusal, HasSubstr("has 2 coordinates, must have 3"));
      ++refused;
    }
  }
  EXPECT_GT(refused, 30);
}

TEST(CrashReportTest, ACrashIsARefusalOfTheFile) {
  for (const int number : {SIGSEGV, SIGABRT, SIGFPE}) {
    EXPECT_EXIT(
        {
          const CrashReport report("a.stp: crashed", 2);
          raise(number);
        },
        ::testing::ExitedWithCode(2),
        "a\\.stp: crashed \\(signal 0?" + std::to_string(number) + "\\)");
  }
}

// --- The program ---------------------------------------------------------------------------------

TEST_F(StepReadingTest, TheProgramRefusesWithTheReason) {
  StepProgramOptions program;
  if (const char* bin = std::getenv("SIGHTLINE_BIN_DIR")) {
    program.program = std::string(bin) + "/sightline_step_import";
  }
  const fs::path folder = fs::temp_directory_path();
  const std::string path = (folder / ("-refused " + std::to_string(getpid()) + ".stp")).string();
  const auto run = [&](const std::string& text, std::vector<std::string> arguments) {
    std::ofstream(path, std::ios::trunc) << text;
    arguments.insert(arguments.end(), {"--out", path + ".glb"});
    return RunStepImport(path, arguments, program);
  };
  const std::string no_unit = absl::StrReplaceAll(
      Tessellated("TRIANGULATED_FACE('',#6,4,(),$,(2,3,4,5),((1,3,2),(1,2,4),(1,4,3),(2,3,4)))"),
      {{"GLOBAL_UNIT_ASSIGNED_CONTEXT((#3))", ""}});
  const absl::Status missing = run(no_unit, {}).status();
  EXPECT_TRUE(IsMissingStepUnit(missing)) << missing;
  EXPECT_THAT(std::string(missing.message()), AllOf(HasSubstr(path), HasSubstr("--unit")));
  EXPECT_TRUE(run(no_unit, {"--unit", "mm"}).ok());
  const std::string squares = BindSquares(box_and_squares_, kByRelationship);
  const auto read = run(squares, {});
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_THAT(*read, HasSubstr("remark: left out as construction geometry: \"Extract.1\""));
  const absl::Status damaged =
      run(std::regex_replace(box_, std::regex("(CARTESIAN_POINT\\('',\\([^,]+,[^,]+),[^,)]+\\)"),
                             "$1)"),
          {})
          .status();
  EXPECT_EQ(damaged.code(), absl::StatusCode::kInvalidArgument) << damaged;
  fs::remove(path);
  fs::remove(path + ".glb");
}

// --- Length units --------------------------------------------------------------------------------

constexpr char kMillimetre[] = "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))";

// The box's length unit defined as `unit`; `more`: further instances, numbered from #900001, of
// which `second` may be a second unit of the same context. $UNIT is the number of the first.
std::string WithLengthUnit(const std::string& text, const std::string& unit,
                           const std::string& more, const std::string& second) {
  const std::regex millimetre(
      R"((#\d+) *= *\( *LENGTH_UNIT\(\) *NAMED_UNIT\(\*\) *SI_UNIT\(\.MILLI\.,\.METRE\.\) *\);)");
  std::smatch match;
  EXPECT_TRUE(std::regex_search(text, match, millimetre));
  const std::string id = match[1];
  const std::string definitions =
      absl::StrReplaceAll(id + "=" + unit + ";\n" + more, {{"$UNIT", id}});
  const std::regex context("GLOBAL_UNIT_ASSIGNED_CONTEXT\\s*\\(\\s*\\(");
  std::string stated = text;
  stated.replace(static_cast<size_t>(match.position()), static_cast<size_t>(match.length()),
                 definitions);
  if (second.empty()) return stated;
  EXPECT_TRUE(std::regex_search(stated, context));
  return std::regex_replace(stated, context, "GLOBAL_UNIT_ASSIGNED_CONTEXT((" + second + ",");
}

// The unit `name`, whose factor is the instance `measure`.
std::string Conversion(const std::string& name, const std::string& measure) {
  return "(CONVERSION_BASED_UNIT('" + name + "'," + measure + ")LENGTH_UNIT()NAMED_UNIT(#900001))";
}
// The instance `id`: `factor` of the unit `base`.
std::string Measure(const std::string& id, const std::string& factor, const std::string& base) {
  return "#900001=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\n" + id +
         "=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(" + factor + ")," + base + ");\n";
}
// The instance #900002: `factor` of the unit #900003, which is `base_unit`.
std::string InchOf(const std::string& factor, const std::string& base_unit = kMillimetre) {
  return Measure("#900002", factor, "#900003") + "#900003=" + base_unit + ";\n";
}

struct LengthUnitCase {
  std::string unit, more, second;
  double millimetres = 0;  // 0: refused with these words
  std::vector<std::string> words = {};
};

std::vector<LengthUnitCase> LengthUnitCases() {
  const auto si = [](const std::string& values) {
    return "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(" + values + "))";
  };
  const std::string inch = Conversion("INCH", "#900002");
  const std::string foot_in_inch =
      "#900002=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(12.),#900004);\n"
      "#900004=" +
      Conversion("INCH", "#900005") + ";\n" + Measure("#900005", "25.4", "#900006") +
      "#900006=" + kMillimetre + ";\n";
  return {
      {si(".MILLI.,.METRE."), "", "", 1},
      {si(".CENTI.,.METRE."), "", "", 10},
      {si(".DECI.,.METRE."), "", "", 100},
      {si("$,.METRE."), "", "", 1e3},
      {inch, InchOf("25.4"), "", 25.4},
      {inch, InchOf("2.54", si(".CENTI.,.METRE.")), "", 25.4},
      {Conversion("FOOT", "#900002"), foot_in_inch, "", 304.8},
      {Conversion("anything", "#900002"), InchOf("3."), "", 3},
      {kMillimetre, "#900001=" + std::string(kMillimetre) + ";\n", "#900001", 1},
      {si(".MILLI.,.METER."), "", "", 0, {".METER.", "must be .METRE."}},
      {si(".MILI.,.METRE."), "", "", 0, {".MILI.", "prefix"}},
      {si("'MILLI',.METRE."), "", "", 0, {"'MILLI'", "prefix"}},
      {si("*,.METRE."), "", "", 0, {"prefix *", "must be $"}},
      {si(".MILLI.,.GRAM."), "", "", 0, {".GRAM.", "must be .METRE."}},
      {kMillimetre,
       "#900004=" + inch + ";\n" + InchOf("25.4"),
       "#900004",
       0,
       {"two length units", "inch (#900004)", "millimetre (#"}},
      {inch, InchOf("25.4"), "#900003", 0, {"two length units", "millimetre (#900003)", "inch (#"}},
      {inch, InchOf("1.0"), "", 0, {"INCH", "contradicts", "must be 25.4 mm"}},
      {inch, InchOf("25.4", si("$,.METRE.")), "", 0, {"INCH", "contradicts", "must be 25.4 mm"}},
      {Conversion("mil", "#900002"), InchOf("2.54"), "", 0, {"mil", "must be 0.0254 mm"}},
      {inch, InchOf("-25.4"), "", 0, {"#900002", "INCH is -25.4", "> 0"}},
      {inch, InchOf("0."), "", 0, {"#900002", "INCH is 0", "> 0"}},
      {inch, Measure("#900002", "25.4", "$UNIT"), "", 0, {"more than 8 conversions"}},
      {"(CONTEXT_DEPENDENT_UNIT('FURLONG')LENGTH_UNIT()NAMED_UNIT(#900001))",
       "#900001=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\n",
       "",
       0,
       {"unit FURLONG is not read"}},
  };
}

TEST_F(StepReadingTest, ALengthUnitIsReadAsStatedOrRefusedWithTheReason) {
  StepReadOptions given;
  given.unit = "mm";
  for (const LengthUnitCase& unit : LengthUnitCases()) {
    SCOPED_TRACE(unit.unit + " " + unit.more);
    const std::string text = WithLengthUnit(box_, unit.unit, unit.more, unit.second);
    const std::string refusal = Refusal(text);
    // A unit that is given never takes the place of one that the file states.
    const std::string refusal_of_given = Refusal(text, given);
    if (unit.millimetres > 0) {
      ASSERT_EQ(refusal, "");
      const double volume_mm3 = HealthOf(Read(text).bodies.at(0)).volume_mm3;
      EXPECT_NEAR(volume_mm3 / (30000 * std::pow(unit.millimetres, 3)), 1, 1e-6);
      EXPECT_THAT(refusal_of_given, HasSubstr("says its unit itself"));
      continue;
    }
    EXPECT_THAT(refusal, HasSubstr("test.stp: #"));
    for (const std::string& word : unit.words) EXPECT_THAT(refusal, HasSubstr(word));
    EXPECT_EQ(refusal_of_given, refusal);
  }
}

TEST_F(StepReadingTest, MoreThanThreeCoordinatesAreRefused) {
  for (const std::string type : {"CARTESIAN_POINT", "DIRECTION"}) {
    const std::regex triple("(#\\d+) *= *" + type + "\\('[^']*',\\([^,()]+,[^,()]+,[^,()]+");
    std::smatch match;
    ASSERT_TRUE(std::regex_search(box_, match, triple));
    std::string text = box_;
    text.insert(static_cast<size_t>(match.position() + match.length()), ",7.");
    EXPECT_THAT(Refusal(text), AllOf(HasSubstr(match[1].str() + " " + type),
                                     HasSubstr("has 4 coordinates, must have 3")));
  }
}

}  // namespace
}  // namespace sightline
