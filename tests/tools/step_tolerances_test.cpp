// SPDX-License-Identifier: Apache-2.0
// Tolerances of STEP files: from hand-written entities, on shapes that OpenCASCADE writes, through
// the program, and of whole files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <Eigen/Geometry>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <STEPCAFControl_Writer.hxx>
#include <STEPControl_Writer.hxx>
#include <TDocStd_Document.hxx>
#include <TopLoc_Location.hxx>
#include <TopoDS_Shape.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <gp_Trsf.hxx>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <sstream>

#include "core/part/load_part.h"
#include "core/part/mesh.h"
#include "core/tolerance/face_surface.h"
#include "planner_client/tolerance_import/tolerance_import.h"
#include "tests/limits/within_limits.h"
#include "tools/step_import/glb_writer.h"
#include "tools/step_import/shape_mesh.h"
#include "tools/step_import/step_reader.h"
#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/step_pmi.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

// --- Hand-written entities
// ------------------------------------------------------------------------

// Entities of a STEP file, numbered as they are added.
class Entities {
 public:
  explicit Entities(int64_t first = 1) : next_(first) {}

  // "#12" of the new entity.
  std::string Add(const std::string& entity) {
    const std::string id = "#" + std::to_string(next_++);
    text_ += id + "=" + entity + ";\n";
    return id;
  }
  std::string Length(double value, const std::string& unit) {
    return Add("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(" + Real(value) + ")," + unit + ")");
  }
  // As CATIA writes it: complex, with a name.
  std::string NamedLength(const std::string& name, double value, const std::string& unit) {
    return Add(
        "(LENGTH_MEASURE_WITH_UNIT()MEASURE_REPRESENTATION_ITEM()MEASURE_WITH_UNIT("
        "LENGTH_MEASURE(" +
        Real(value) + ")," + unit + ")REPRESENTATION_ITEM('" + name + "'))");
  }
  std::string Millimetre() { return Add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))"); }
  std::string Inch() {
    const std::string mm = Millimetre();
    return Add("(CONVERSION_BASED_UNIT('INCH'," + Length(25.4, mm) +
               ")LENGTH_UNIT()NAMED_UNIT(*))");
  }
  std::string Aspect() { return Add("SHAPE_ASPECT('','',#900000,.T.)"); }
  const std::string& text() const { return text_; }
  std::string File() const {
    return "ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('AP242_MANAGED_MODEL_BASED'));\nENDSEC;\nDATA;\n" +
           text_ + "ENDSEC;\nEND-ISO-10303-21;\n";
  }
  ToleranceReport Read() const { return ReadStepPmi(Part21File(File(), "test.stp")).report; }

  static std::string Real(double value) {
    std::ostringstream out;
    out.precision(17);
    out << value;
    const std::string text = out.str();
    return text.find_first_of(".e") == std::string::npos ? text + "." : text;
  }

 private:
  int64_t next_;
  std::string text_;
};

std::string Reasons(const ToleranceReport& report) {
  std::string all;
  for (const UnreadTolerance& unread : report.not_read) {
    all += unread.name + ": " + unread.reason + "\n";
  }
  return all;
}

void ExpectEverythingAccounted(const ToleranceReport& report) {
  EXPECT_EQ(static_cast<size_t>(report.entity_count),
            report.read.size() + report.untoleranced.size() + report.datums.size() +
                report.not_read.size());
}

TEST(Part21Test, ReadsWhatTheStandardAllows) {
  const Part21File file(
      "ISO-10303-21;\nHEADER;FILE_SCHEMA(('AP242_X','B'));ENDSEC;DATA;\n"
      "/* a comment; with #9=NOTHING(); */ #1 = THING ( 'it''s; (#7)' , $, * , .T., 1.5E-3,\n"
      "  -7, #2, (#2,(1,2)), LENGTH_MEASURE(0.2), '\\X2\\00D8\\X0\\ 5 \\X\\B0', \"0A\" );\n"
      "#2=(A(1)B()C('x'));\nENDSEC;END-ISO-10303-21;",
      "test.stp");
  EXPECT_EQ(file.schema(), "AP242_X");
  EXPECT_FALSE(file.Has(9));
  const auto records = file.Records(1);
  ASSERT_THAT(records, SizeIs(1));
  EXPECT_EQ(records[0].type, "THING");
  const auto& values = records[0].values;
  ASSERT_THAT(values, SizeIs(11));
  EXPECT_EQ(values[0].text, "it's; (#7)");
  EXPECT_EQ(values[1].kind, Part21Value::Kind::kUnset);
  EXPECT_EQ(values[2].kind, Part21Value::Kind::kDerived);
  EXPECT_EQ(values[3].text, "T");
  EXPECT_DOUBLE_EQ(values[4].number, 1.5e-3);
  EXPECT_DOUBLE_EQ(values[5].number, -7);
  EXPECT_EQ(values[6].reference, 2);
  EXPECT_EQ(values[7].list[1].list[1].number, 2);
  EXPECT_EQ(values[8].text, "LENGTH_MEASURE");
  EXPECT_DOUBLE_EQ(values[8].list[0].number, 0.2);
  EXPECT_EQ(values[9].text, "\u00d8 5 \u00b0");
  EXPECT_THAT(file.Types(2), ElementsAre("A", "B", "C"));
  EXPECT_TRUE(file.IsA(2, "B"));
  EXPECT_THAT(file.Records(2), SizeIs(3));
}

TEST(Part21Test, FaultsAreNamed) {
  const auto error = [](const std::string& data) {
    try {
      const Part21File file("DATA;" + data, "test.stp");
      file.Records(1);
      return std::string("accepted");
    } catch (const StepInputError& failure) {
      return std::string(failure.what());
    }
  };
  EXPECT_EQ(error("#1=A(1);"), "accepted");
  EXPECT_THAT(error("#2=A(1);"), HasSubstr("#1 is missing"));
  EXPECT_THAT(error("#1=A(1);#1=B(1);"), HasSubstr("#1 is there twice"));
  EXPECT_THAT(error(""), HasSubstr("no instance"));
  EXPECT_THAT(error("#x=A(1);"), HasSubstr("malformed"));
  for (const char* bad : {"#1=A(1;", "#1=A(1,);", "#1=A('x);", "#1=A(.T);", "#1=(A(1)", "#1=A",
                          "#1=A(1)B(2);", "#1=A(#);", "#1=;"}) {
    EXPECT_THAT(error(bad), HasSubstr("test.stp: #1")) << bad;
  }
  EXPECT_THAT(error("#1=A(" + std::string(100000, '(') + ";"), HasSubstr("nests too deeply"));
  std::string values, types;
  for (int i = 0; i < 1'000'000; ++i) values += "1,";
  for (int i = 0; i < 100; ++i) types += "A()";
  EXPECT_EQ(error("#1=A(" + values.substr(2) + "1);"), "accepted");
  EXPECT_THAT(error("#1=A(" + values + "1);"), HasSubstr("#1 has more than 1000000 values"));
  EXPECT_EQ(error("#1=(" + types + ");"), "accepted");
  EXPECT_THAT(error("#1=(" + types + "B());"), HasSubstr("#1 has more than 100 types"));
  EXPECT_THAT(error("#1=" + std::string(201, 'A') + "(1);"), HasSubstr("more than 200 characters"));
}

TEST(StepPmiTest, ReadsGeometricTolerances) {
  Entities e;
  const std::string mm = e.Millimetre(), inch = e.Inch();
  const std::string a = e.Add("DATUM('','',#900000,.F.,'A')");
  const std::string b = e.Add("DATUM('','',#900000,.F.,'B')");
  const std::string c = e.Add("DATUM('','',#900000,.F.,'C')");
  const std::string first = e.Add("DATUM_REFERENCE_COMPARTMENT('',$,#900000,.F.," + a + ",$)");
  const std::string second =
      e.Add("DATUM_REFERENCE_COMPARTMENT('',$,#900000,.F.," + b +
            ",(SIMPLE_DATUM_REFERENCE_MODIFIER(.MAXIMUM_MATERIAL_REQUIREMENT.)))");
  const std::string one = e.Add("DATUM_REFERENCE_ELEMENT('',$,#900000,.F.," + b + ",$)");
  const std::string other = e.Add("DATUM_REFERENCE_ELEMENT('',$,#900000,.F.," + c + ",$)");
  const std::string common =
      e.Add("DATUM_REFERENCE_COMPARTMENT('',$,#900000,.F.,COMMON_DATUM_LIST((" + one + "," + other +
            ")),$)");
  const std::string system = e.Add("DATUM_SYSTEM('',$,#900000,.F.,(" + first + "," + second + "))");
  const std::string pair = e.Add("DATUM_SYSTEM('',$,#900000,.F.,(" + common + "))");

  e.Add("FLATNESS_TOLERANCE('Flat','d'," + e.Length(0.2, mm) + "," + e.Aspect() + ")");
  const std::string position =
      e.Add("(GEOMETRIC_TOLERANCE('Pos',''," + e.NamedLength("", 0.01, inch) + "," + e.Aspect() +
            ")GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE((" + system +
            "))GEOMETRIC_TOLERANCE_WITH_MODIFIERS((.MAXIMUM_MATERIAL_REQUIREMENT.))"
            "POSITION_TOLERANCE())");
  e.Add("TOLERANCE_ZONE('','',#900000,.F.,(" + position + ")," +
        e.Add("TOLERANCE_ZONE_FORM('cylindrical or circular')") + ")");
  e.Add("CIRCULAR_RUNOUT_TOLERANCE('',''," + e.Length(0.035, mm) + "," + e.Aspect() + ",(" + pair +
        "))");
  e.Add("(FLATNESS_TOLERANCE()GEOMETRIC_TOLERANCE('Per',''," + e.Length(0.1, mm) + "," +
        e.Aspect() +
        ")GEOMETRIC_TOLERANCE_WITH_DEFINED_AREA_UNIT(.SQUARE.,$)"
        "GEOMETRIC_TOLERANCE_WITH_DEFINED_UNIT(" +
        e.Length(25, mm) + "))");
  e.Add("(GEOMETRIC_TOLERANCE('Uneven',''," + e.Length(1, mm) + "," + e.Aspect() +
        ")SURFACE_PROFILE_TOLERANCE()UNEQUALLY_DISPOSED_GEOMETRIC_TOLERANCE(" + e.Length(0.3, mm) +
        "))");
  // AP203 and AP214: datums by precedence, not by their place in the list.
  e.Add("PARALLELISM_TOLERANCE('Old',''," + e.Length(0.05, mm) + "," + e.Aspect() + ",(" +
        e.Add("DATUM_REFERENCE(2," + b + ")") + "," + e.Add("DATUM_REFERENCE(1," + c + ")") + "))");
  const ToleranceReport report = e.Read();
  ExpectEverythingAccounted(report);
  EXPECT_THAT(report.not_read, IsEmpty()) << Reasons(report);
  EXPECT_EQ(report.standard, "AP242");
  EXPECT_THAT(report.datums, SizeIs(3));
  std::map<std::string, Tolerance> by_name;
  for (const Tolerance& tolerance : report.read) by_name[tolerance.name] = tolerance;
  ASSERT_THAT(by_name, SizeIs(6));
  EXPECT_DOUBLE_EQ(by_name["Flat"].zone_width_m, 0.2e-3);
  EXPECT_DOUBLE_EQ(by_name["Pos"].zone_width_m, 0.254e-3);
  EXPECT_TRUE(by_name["Pos"].diameter_zone);
  EXPECT_FALSE(by_name["Flat"].diameter_zone);
  EXPECT_THAT(by_name["Pos"].datums, ElementsAre("A", "B(M)"));
  EXPECT_EQ(by_name["Pos"].text,
            "position diameter 0.254 mm maximum material requirement | A | B(M)");
  EXPECT_THAT(by_name["d"].datums, IsEmpty());
  EXPECT_EQ(by_name["circular runout"].kind, ToleranceKind::kCircularRunout);
  EXPECT_THAT(by_name["circular runout"].datums, ElementsAre("B-C"));
  EXPECT_THAT(by_name["Per"].modifiers, ElementsAre("per 25 mm square"));
  EXPECT_THAT(by_name["Uneven"].modifiers, ElementsAre("unequally disposed by 0.3 mm"));
  EXPECT_THAT(by_name["Old"].datums, ElementsAre("C", "B"));
}

// Value and limits of a size: deviations, limits, or none.
TEST(StepPmiTest, ReadsDimensions) {
  Entities e;
  const std::string mm = e.Millimetre(), inch = e.Inch();
  const std::string radian = e.Add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
  const auto represent = [&](const std::string& dimension, const std::string& items) {
    e.Add("DIMENSIONAL_CHARACTERISTIC_REPRESENTATION(" + dimension + "," +
          e.Add("SHAPE_DIMENSION_REPRESENTATION('',(" + items + "),#900001)") + ")");
  };
  const auto deviations = [&](const std::string& dimension, double low, double high) {
    e.Add("PLUS_MINUS_TOLERANCE(" +
          e.Add("TOLERANCE_VALUE(" + e.Length(low, mm) + "," + e.Length(high, mm) + ")") + "," +
          dimension + ")");
  };
  const std::string plus_minus = e.Add("DIMENSIONAL_SIZE(" + e.Aspect() + ",'diameter')");
  represent(plus_minus, e.NamedLength("nominal value", 2, inch));
  deviations(plus_minus, -0.1, 0.05);
  const std::string limits = e.Add("DIMENSIONAL_SIZE(" + e.Aspect() + ",'radius')");
  represent(limits,
            e.NamedLength("upper limit", 35.2, mm) + "," + e.NamedLength("lower limit", 34.8, mm));
  const std::string basic =
      e.Add("DIMENSIONAL_LOCATION('linear distance',$," + e.Aspect() + "," + e.Aspect() + ")");
  represent(basic, e.NamedLength("nominal value", 31, mm) + "," +
                       e.Add("DESCRIPTIVE_REPRESENTATION_ITEM('dimensional note','theoretical')"));
  const std::string angle =
      e.Add("ANGULAR_LOCATION('angle',$," + e.Aspect() + "," + e.Aspect() + ",.SMALL.)");
  const auto radians = [&](double value) {
    return e.Add("PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE(" + Entities::Real(value) +
                 ")," + radian + ")");
  };
  represent(angle, radians(1));
  e.Add("PLUS_MINUS_TOLERANCE(" +
        e.Add("TOLERANCE_VALUE(" + radians(-0.01) + "," + radians(0.01) + ")") + "," + angle + ")");
  const ToleranceReport report = e.Read();
  ExpectEverythingAccounted(report);
  ASSERT_THAT(report.read, SizeIs(3)) << Reasons(report);
  EXPECT_NEAR(report.read[0].nominal_m.value(), 0.0508, 1e-15);
  EXPECT_NEAR(report.read[0].lower_m.value(), 0.0507, 1e-15);
  EXPECT_NEAR(report.read[0].zone_width_m, 0.15e-3, 1e-15);
  EXPECT_EQ(report.read[0].text, "diameter 50.8 +0.05/-0.1 mm");
  EXPECT_NEAR(report.read[1].zone_width_m, 0.4e-3, 1e-15);
  EXPECT_EQ(report.read[1].text, "radius 34.8 to 35.2 mm");
  EXPECT_EQ(report.read[2].kind, ToleranceKind::kAngularDistance);
  EXPECT_NEAR(report.read[2].zone_width_rad, 0.02, 1e-15);
  EXPECT_EQ(report.read[2].zone_width_m, 0);
  ASSERT_THAT(report.untoleranced, SizeIs(1));
  EXPECT_EQ(report.untoleranced[0].text, "linear distance 31 mm, theoretical");
}

TEST(StepPmiTest, WhatCannotBeReadIsListedWithTheReason) {
  Entities e;
  const std::string mm = e.Millimetre();
  const std::string good = e.Length(0.1, mm);
  e.Add("WAVINESS_TOLERANCE('Wavy',''," + good + "," + e.Aspect() + ")");
  e.Add("FLATNESS_TOLERANCE('NoUnit',''," +
        e.Add("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.2),$)") + "," + e.Aspect() + ")");
  e.Add("FLATNESS_TOLERANCE('Gone','',#800000," + e.Aspect() + ")");
  e.Add("FLATNESS_TOLERANCE('Unset','',$," + e.Aspect() + ")");
  e.Add("FLATNESS_TOLERANCE('Zero',''," + e.Length(0, mm) + "," + e.Aspect() + ")");
  e.Add("FLATNESS_TOLERANCE('Negative',''," + e.Length(-1, mm) + "," + e.Aspect() + ")");
  e.Add("FLATNESS_TOLERANCE('Mass',''," +
        e.Length(1, e.Add("(MASS_UNIT()NAMED_UNIT(*)SI_UNIT(.KILO.,.GRAM.))")) + "," + e.Aspect() +
        ")");
  e.Add("FLATNESS_TOLERANCE('Short','')");
  const std::string uneven =
      e.Add("LINE_PROFILE_TOLERANCE('Wedge',''," + good + "," + e.Aspect() + ")");
  e.Add("NON_UNIFORM_ZONE_DEFINITION(" +
        e.Add("TOLERANCE_ZONE('','',#900000,.F.,(" + uneven + ")," +
              e.Add("TOLERANCE_ZONE_FORM('non uniform')") + ")") +
        ",())");
  const std::string fit = e.Add("DIMENSIONAL_SIZE(" + e.Aspect() + ",'diameter')");
  e.Add("PLUS_MINUS_TOLERANCE(" + e.Add("LIMITS_AND_FITS('H','hole','7','ISO 286')") + "," + fit +
        ")");
  e.Add("DIMENSIONAL_SIZE(" + e.Aspect() + ",'Novalue')");
  e.Add("PLUS_MINUS_TOLERANCE(#700000,#700001)");
  e.Add("DATUM_FEATURE('Lonely','',#900000,.T.)");
  const std::string swapped = e.Add("DIMENSIONAL_SIZE(" + e.Aspect() + ",'Swapped')");
  e.Add("DIMENSIONAL_CHARACTERISTIC_REPRESENTATION(" + swapped + "," +
        e.Add("SHAPE_DIMENSION_REPRESENTATION('',(" + e.NamedLength("upper limit", 1, mm) + "," +
              e.NamedLength("lower limit", 2, mm) + "),#900001)") +
        ")");
  const ToleranceReport report = e.Read();
  ExpectEverythingAccounted(report);
  EXPECT_THAT(report.read, IsEmpty());
  EXPECT_THAT(report.not_read, SizeIs(14));
  const std::string reasons = Reasons(report);
  for (const auto& [name, reason] :
       std::vector<std::pair<std::string, std::string>>{{"Wavy", "unknown"},
                                                        {"NoUnit", "no unit"},
                                                        {"Gone", "#800000 is missing"},
                                                        {"Unset", "magnitude is not given"},
                                                        {"Zero", "zone width is 0 mm"},
                                                        {"Negative", "zone width is -1 mm"},
                                                        {"Mass", "gram"},
                                                        {"Short", "no magnitude"},
                                                        {"Wedge", "not of one width"},
                                                        {"diameter", "tolerance class H7"},
                                                        {"Novalue", "no value"},
                                                        {"PLUS_MINUS_TOLERANCE", "no dimension"},
                                                        {"Lonely", "no datum"},
                                                        {"Swapped", "not below"}}) {
    EXPECT_THAT(reasons, ::testing::ContainsRegex(name + "[^\n]*(" + reason + ")"));
  }
}

TEST(StepPmiTest, ReferencesInACircleEnd) {
  Entities e;
  // A unit that is defined by itself, aspects that consist of one another, a system of itself.
  e.Add("(CONVERSION_BASED_UNIT('LOOP',#2)LENGTH_UNIT()NAMED_UNIT(*))");
  e.Add("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.),#1)");
  e.Add("FLATNESS_TOLERANCE('Loop','',#2,#4)");
  e.Add("SHAPE_ASPECT('','',#900000,.T.)");
  e.Add("SHAPE_ASPECT('','',#900000,.T.)");
  e.Add("SHAPE_ASPECT_RELATIONSHIP('','',#4,#5)");
  e.Add("SHAPE_ASPECT_RELATIONSHIP('','',#5,#4)");
  const std::string mm = e.Millimetre();
  const std::string length = e.Length(1, mm);
  e.Add("FLATNESS_TOLERANCE('Aspects',''," + length + ",#4)");
  const std::string self = "#" + std::to_string(12);
  e.Add("DATUM_REFERENCE_COMPARTMENT('',$,#900000,.F.," + self + ",$)");
  e.Add("PARALLELISM_TOLERANCE('System',''," + length + ",#4,(" +
        e.Add("DATUM_SYSTEM('',$,#900000,.F.,(" + self + "))") + "))");
  const ToleranceReport report = e.Read();
  ExpectEverythingAccounted(report);
  ASSERT_THAT(report.read, SizeIs(1)) << Reasons(report);
  EXPECT_EQ(report.read[0].name, "Aspects");
  EXPECT_THAT(Reasons(report), AllOf(HasSubstr("Loop"), HasSubstr("itself")));
}

// "(#500001,#500002,...)", or the same entity so many times.
std::string References(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += (i > 0 ? ",#" : "(#") + std::to_string(500'001 + i);
  return text + ")";
}
std::string References(int count, const std::string& id) {
  std::string text;
  for (int i = 0; i < count; ++i) text += (i > 0 ? "," : "(") + id;
  return text + ")";
}

void AddItems(Entities& e, const std::string& aspect, const std::string& items) {
  e.Add("GEOMETRIC_ITEM_SPECIFIC_USAGE('',''," + aspect + ",#900001," + items + ")");
}

// Tolerances of the files below refer to one thing that is large: what is read must not grow as the
// product. The error, or how many tolerances and datums there are.
std::string ReadWithinLimits(const Entities& entities) {
  const std::string text = entities.File();
  return WithinLimits({.cpu_time_s = 20, .memory_bytes = int64_t{1} << 30}, [&]() -> std::string {
    try {
      const StepPmi pmi = ReadStepPmi(Part21File(text, "test.stp"));
      return std::to_string(pmi.read.size()) + " and " + std::to_string(pmi.datums.size());
    } catch (const StepInputError& error) {
      return error.what();
    }
  });
}

TEST(StepPmiTest, ReferencesDoNotMultiplyItems) {
  const auto refused = AllOf(HasSubstr("test.stp: #"), HasSubstr("refer to each other so often"));
  constexpr int kItems = 30'000, kTolerances = 3000;
  Entities one, geometric, unread, dimensions, datums, sets;
  for (Entities* e : {&one, &geometric, &unread, &dimensions, &datums, &sets}) {
    const std::string mm = e->Millimetre(), aspect = e->Aspect();
    const std::string length = e->Length(e == &unread ? 0 : 0.1, mm);
    if (e != &sets) AddItems(*e, aspect, References(kItems));
    const std::string set = e->Add("COMPOUND_REPRESENTATION_ITEM('',SET_REPRESENTATION_ITEM(" +
                                   References(kItems) + "))");
    for (int i = 0; i < kTolerances; ++i) {
      if (e == &one && i > 0) break;
      if (e == &dimensions) {
        e->Add("DIMENSIONAL_SIZE(" + aspect + ",'diameter')");
      } else if (e == &datums) {
        const std::string datum = e->Add("DATUM('','',#900000,.F.,'A')");
        e->Add("SHAPE_ASPECT_RELATIONSHIP('',''," + aspect + "," + datum + ")");
      } else if (e == &sets) {
        AddItems(*e, e->Aspect(), set);
        e->Add("FLATNESS_TOLERANCE('',''," + length + ",#" + std::to_string(4 + 3 * i + 1) + ")");
      } else {
        e->Add("FLATNESS_TOLERANCE('',''," + length + "," + aspect + ")");
      }
    }
  }
  EXPECT_EQ(ReadWithinLimits(one), "1 and 0");
  EXPECT_THAT(ReadStepPmi(Part21File(one.File(), "test.stp")).read.at(0).items, SizeIs(kItems));
  EXPECT_THAT(ReadWithinLimits(geometric), refused);
  EXPECT_THAT(ReadWithinLimits(unread), refused);
  EXPECT_THAT(ReadWithinLimits(dimensions), refused);
  EXPECT_THAT(ReadWithinLimits(datums), refused);
  EXPECT_THAT(ReadWithinLimits(sets), refused);
}

TEST(StepPmiTest, ReferencesDoNotMultiplyTexts) {
  const auto refused = AllOf(HasSubstr("test.stp: #"), HasSubstr("refer to each other so often"));
  constexpr int kTolerances = 3000;
  Entities systems, nested, forms;
  for (Entities* e : {&systems, &nested, &forms}) {
    const std::string mm = e->Millimetre(), aspect = e->Aspect(), length = e->Length(0.1, mm);
    const std::string datum = e->Add("DATUM('','',#900000,.F.,'A')");
    std::string datum_system;
    if (e == &systems) {
      const std::string compartment =
          e->Add("DATUM_REFERENCE_COMPARTMENT('',$,#900000,.F.," + datum + ",$)");
      datum_system =
          e->Add("DATUM_SYSTEM('',$,#900000,.F.," + References(20'000, compartment) + ")");
    } else {
      // Every compartment has the one before 300 times.
      datum_system = datum;
      for (int depth = 0; depth < 4; ++depth) {
        datum_system = e->Add("DATUM_REFERENCE_COMPARTMENT('',$,#900000,.F.," +
                              References(300, datum_system) + ",$)");
      }
    }
    std::string tolerances;
    for (int i = 0; i < kTolerances; ++i) {
      const std::string datums = e == &forms ? "" : ",(" + datum_system + ")";
      const std::string id =
          e->Add("PARALLELISM_TOLERANCE('',''," + length + "," + aspect + datums + ")");
      tolerances += (i > 0 ? "," : "") + id;
    }
    if (e != &forms) continue;
    const std::string form = e->Add("TOLERANCE_ZONE_FORM('" + std::string(1 << 20, 'a') + "')");
    e->Add("TOLERANCE_ZONE('','',#900000,.F.,(" + tolerances + ")," + form + ")");
  }
  EXPECT_THAT(ReadWithinLimits(systems), refused);
  EXPECT_THAT(ReadWithinLimits(nested), refused);
  EXPECT_THAT(ReadWithinLimits(forms), refused);
}

// Much, but only as much as the file says.
TEST(StepPmiTest, LargeFilesAreRead) {
  Entities e;
  const std::string mm = e.Millimetre();
  for (int i = 0; i < 20'000; ++i) {
    const std::string aspect = e.Aspect();
    AddItems(e, aspect, References(10));
    e.Add("FLATNESS_TOLERANCE('flat',''," + e.Length(0.1, mm) + "," + aspect + ")");
  }
  EXPECT_EQ(ReadWithinLimits(e), "20000 and 0");
  // A datum of many features.
  Entities features;
  const std::string datum = features.Add("DATUM('','',#900000,.F.,'A')");
  for (int i = 0; i < 3000; ++i) {
    const std::string feature = features.Add("DATUM_FEATURE('','',#900000,.T.)");
    features.Add("SHAPE_ASPECT_RELATIONSHIP('',''," + feature + "," + datum + ")");
    std::string items;
    for (int k = 0; k < 100; ++k) {
      items += (k > 0 ? ",#" : "(#") + std::to_string(500'001 + 100 * i + k);
    }
    AddItems(features, feature, items + ")");
  }
  EXPECT_EQ(ReadWithinLimits(features), "0 and 1");
  const StepPmi pmi = ReadStepPmi(Part21File(features.File(), "test.stp"));
  EXPECT_EQ(pmi.datums.at(0).items.size(), 300'000u);
  EXPECT_TRUE(std::ranges::is_sorted(pmi.datums.at(0).items));
}

TEST(StepPmiTest, DrawnAnnotationsAreNoTolerances) {
  Entities e;
  e.Add("DRAUGHTING_CALLOUT('Flatness.1',())");
  const ToleranceReport report = e.Read();
  EXPECT_EQ(report.entity_count, 0);
  ASSERT_THAT(report.notes, SizeIs(1));
  EXPECT_THAT(report.notes[0], HasSubstr("graphics only"));
}

// --- Shapes
// ---------------------------------------------------------------------------------------

class StepShapeTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) /
              (std::string("step_tolerances_") +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    Message::DefaultMessenger()->ChangePrinters().Clear();  // they print on standard output
    Interface_Static::SetCVal("write.step.schema", "AP242DIS");
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string PathOf(const std::string& name) const { return (folder_ / name).string(); }

  std::string WriteShape(const TopoDS_Shape& shape, const std::string& name) const {
    STEPControl_Writer writer;
    EXPECT_EQ(writer.Transfer(shape, STEPControl_AsIs), IFSelect_RetDone);
    EXPECT_EQ(writer.Write(PathOf(name).c_str()), IFSelect_RetDone);
    return PathOf(name);
  }

  static std::string Text(const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }

  fs::path folder_;
};

// Adds a flatness of 0.01, 0.02, ... mm to every face of a STEP file; their numbers in that order.
std::vector<int64_t> ToleranceEveryFace(const std::string& text, const std::string& path) {
  const Part21File file(text, path);
  const auto ids = [&](std::string_view type) {
    return file.Find([&](std::string_view t) { return t == type; });
  };
  const std::vector<int64_t> faces = ids("ADVANCED_FACE");
  const std::string shape = "#" + std::to_string(ids("PRODUCT_DEFINITION_SHAPE").at(0));
  const std::string representation =
      "#" + std::to_string(ids("ADVANCED_BREP_SHAPE_REPRESENTATION").at(0));
  Entities e(800000);
  const std::string mm = e.Millimetre();
  for (size_t i = 0; i < faces.size(); ++i) {
    const std::string aspect = e.Add("SHAPE_ASPECT('',''," + shape + ",.T.)");
    e.Add("GEOMETRIC_ITEM_SPECIFIC_USAGE('',''," + aspect + "," + representation + ",#" +
          std::to_string(faces[i]) + ")");
    e.Add("FLATNESS_TOLERANCE('F" + std::to_string(i) + "',''," +
          e.Length(0.01 * static_cast<double>(i + 1), mm) + "," + aspect + ")");
  }
  std::string out = text;
  out.insert(out.rfind("ENDSEC;"), e.text());
  std::ofstream(path, std::ios::binary | std::ios::trunc) << out;
  return faces;
}

struct Plane {
  Vector3d point_m, normal;
};

// Plane of an ADVANCED_FACE by its entities, [m].
Plane PlaneOf(const Part21File& file, int64_t face) {
  const auto values = [&](int64_t id) { return file.Records(id).at(0).values; };
  const auto vector = [&](int64_t id) {
    const auto list = values(id).at(1).list;
    return Vector3d(list.at(0).number, list.at(1).number, list.at(2).number);
  };
  const auto placement = values(values(values(face).at(2).reference).at(1).reference);
  return {1e-3 * vector(placement.at(1).reference), vector(placement.at(2).reference)};
}

std::vector<FaceTriangles> MeshedFaces(const StepModel& model) {
  std::vector<FaceTriangles> all;
  for (const StepBody& body : model.bodies) {
    static_cast<void>(MeshShape(body.shape, {}));
    for (FaceTriangles& face : TriangulatedFaces(body.shape, false)) {
      face.face = static_cast<int>(all.size() + 1);
      all.push_back(std::move(face));
    }
  }
  return all;
}

TEST_F(StepShapeTest, EachToleranceBindsItsFace) {
  const std::string path =
      WriteShape(BRepPrimAPI_MakeBox(gp_Pnt(-20, 10, 5), 40, 30, 20).Shape(), "box.stp");
  const std::vector<int64_t> entities = ToleranceEveryFace(Text(path), path);
  ASSERT_THAT(entities, SizeIs(6));
  const StepModel model = ReadStep(path, true);
  const ToleranceReport& report = model.tolerances.value();
  ASSERT_THAT(report.read, SizeIs(6)) << Reasons(report);
  ExpectEverythingAccounted(report);
  const std::vector<FaceTriangles> faces = MeshedFaces(model);
  const Part21File file = Part21File::Read(path);
  std::set<int> bound;
  for (size_t i = 0; i < 6; ++i) {
    ASSERT_THAT(report.read[i].faces, SizeIs(1));
    EXPECT_NEAR(report.read[i].zone_width_m, 1e-5 * static_cast<double>(i + 1), 1e-15);
    bound.insert(report.read[i].faces[0]);
    const FaceTriangles& face = faces.at(static_cast<size_t>(report.read[i].faces[0] - 1));
    const Plane plane = PlaneOf(file, entities[i]);
    for (const Vector3d& p : face.positions_m) {
      EXPECT_NEAR((p - plane.point_m).dot(plane.normal), 0, 1e-9);
    }
    for (const auto& t : face.triangles) {
      const Vector3d &a = face.positions_m[t[0]], &b = face.positions_m[t[1]],
                     &c = face.positions_m[t[2]];
      EXPECT_GT((b - a).cross(c - a).dot(a - Vector3d(0, 0.025, 0.015)), 0) << "not outward";
    }
  }
  EXPECT_THAT(bound, SizeIs(6));
  // OpenCASCADE's own reading agrees.
  EXPECT_THAT(report.notes, Contains(HasSubstr("finds 6 on the same faces, 6 of them with the "
                                               "same width")));
}

// Tolerances also bind entities that are no faces: some are named, all count.
TEST_F(StepShapeTest, ManyEntitiesAreNotAllNamed) {
  const std::string path = WriteShape(BRepPrimAPI_MakeBox(40, 30, 20).Shape(), "box.stp");
  const std::string text = Text(path);
  std::vector<int64_t> points, shapes, representations;
  {
    const Part21File file(text, path);
    points = file.Find([](std::string_view t) { return t == "CARTESIAN_POINT"; });
    shapes = file.Find([](std::string_view t) { return t == "PRODUCT_DEFINITION_SHAPE"; });
    representations =
        file.Find([](std::string_view t) { return t == "ADVANCED_BREP_SHAPE_REPRESENTATION"; });
  }
  ASSERT_GT(points.size(), 20u);
  // `times` times all points, to which so many tolerances refer.
  const auto write = [&](int times, int tolerances) {
    Entities e(800000);
    const std::string length = e.Length(0.1, e.Millimetre());
    const std::string aspect =
        e.Add("SHAPE_ASPECT('','',#" + std::to_string(shapes.at(0)) + ",.T.)");
    std::string items;
    for (int i = 0; i < times; ++i) {
      for (const int64_t point : points) {
        items += (items.empty() ? "#" : ",#") + std::to_string(point);
      }
    }
    e.Add("GEOMETRIC_ITEM_SPECIFIC_USAGE('',''," + aspect + ",#" +
          std::to_string(representations.at(0)) + ",(" + items + "))");
    for (int i = 0; i < tolerances; ++i) {
      e.Add("FLATNESS_TOLERANCE('F',''," + length + "," + aspect + ")");
    }
    std::string out = text;
    out.insert(out.rfind("ENDSEC;"), e.text());
    std::ofstream(path, std::ios::binary | std::ios::trunc) << out;
  };
  write(1, 1);
  const ToleranceReport few = ReadStep(path, true).tolerances.value();
  ASSERT_THAT(few.read, SizeIs(1)) << Reasons(few);
  ASSERT_THAT(few.read[0].features, SizeIs(17));
  EXPECT_EQ(few.read[0].features[0], "CARTESIAN_POINT #" + std::to_string(points[0]));
  EXPECT_EQ(few.read[0].features[16], "and " + std::to_string(points.size() - 16) + " more");
  EXPECT_THAT(few.notes, Contains(HasSubstr("compared with OpenCASCADE ")));

  const int times = static_cast<int>(30'000 / points.size());
  write(times, 5);
  const ToleranceReport more = ReadStep(path, true).tolerances.value();
  ASSERT_THAT(more.read, SizeIs(5)) << Reasons(more);
  EXPECT_THAT(more.read[4].features, SizeIs(17));
  EXPECT_THAT(more.notes, Contains(HasSubstr("not compared with OpenCASCADE")));

  write(times, 3000);
  EXPECT_THAT(WithinLimits({.cpu_time_s = 30, .memory_bytes = int64_t{1} << 30},
                           [&]() -> std::string {
                             try {
                               ReadStep(path, true);
                               return "read";
                             } catch (const StepInputError& error) {
                               return error.what();
                             }
                           }),
              AllOf(HasSubstr("box.stp: #"), HasSubstr("refer to each other so often")));
}

TEST_F(StepShapeTest, AnAssemblyBindsAFaceAtEveryPlace) {
  Handle(TDocStd_Document) document = new TDocStd_Document("MDTV-XCAF");
  const Handle(XCAFDoc_ShapeTool) tool = XCAFDoc_DocumentTool::ShapeTool(document->Main());
  const TDF_Label part = tool->AddShape(BRepPrimAPI_MakeBox(10, 10, 10).Shape(), false);
  const TDF_Label assembly = tool->NewShape();
  for (const double x : {0.0, 100.0, 200.0}) {
    gp_Trsf move;
    move.SetTranslation(gp_Vec(x, 0, 0));
    tool->AddComponent(assembly, part, TopLoc_Location(move));
  }
  tool->UpdateAssemblies();
  STEPCAFControl_Writer writer;
  ASSERT_TRUE(writer.Transfer(document));
  const std::string path = PathOf("assembly.stp");
  ASSERT_EQ(writer.Write(path.c_str()), IFSelect_RetDone);
  ASSERT_THAT(ToleranceEveryFace(Text(path), path), SizeIs(6));
  const StepModel model = ReadStep(path, true);
  ASSERT_THAT(model.bodies, SizeIs(3));
  const std::vector<FaceTriangles> faces = MeshedFaces(model);
  ASSERT_THAT(faces, SizeIs(18));
  ASSERT_THAT(model.tolerances->read, SizeIs(6));
  for (const Tolerance& tolerance : model.tolerances->read) {
    ASSERT_THAT(tolerance.faces, SizeIs(3)) << tolerance.name;
    // The same face thrice, 100 mm apart.
    const auto centre = [&](size_t k) {
      const FaceTriangles& face = faces.at(static_cast<size_t>(tolerance.faces[k] - 1));
      Vector3d sum = Vector3d::Zero();
      for (const Vector3d& p : face.positions_m) sum += p;
      return Vector3d(sum / static_cast<double>(face.positions_m.size()));
    };
    EXPECT_NEAR((centre(1) - centre(0) - Vector3d(0.1, 0, 0)).norm(), 0, 1e-9);
    EXPECT_NEAR((centre(2) - centre(0) - Vector3d(0.2, 0, 0)).norm(), 0, 1e-9);
  }
}

// --- The program
// ----------------------------------------------------------------------------------

ToleranceImportOptions Program() {
  ToleranceImportOptions options;
  const char* bin = std::getenv("SIGHTLINE_BIN_DIR");
  if (bin != nullptr) options.step_import_program = std::string(bin) + "/sightline_step_import";
  return options;
}

TEST_F(StepShapeTest, TheProgramHandsOverWhatItRead) {
  const std::string path = WriteShape(BRepPrimAPI_MakeCylinder(10, 40).Shape(), "cylinder.STEP");
  const size_t count = ToleranceEveryFace(Text(path), path).size();
  const auto imported = ImportTolerances(path, Program());
  ASSERT_TRUE(imported.ok()) << imported.status();
  EXPECT_EQ(imported->report.file, "cylinder.STEP");
  ASSERT_THAT(imported->report.read, SizeIs(count));
  ASSERT_THAT(imported->faces, SizeIs(count));
  double area_m2 = 0;
  for (const FaceTriangles& face : imported->faces) {
    const auto surface = FaceSurface::Make(face);
    ASSERT_TRUE(surface.ok()) << surface.status();
    area_m2 += surface->area_m2();
  }
  // Chords of 0.05 mm and 15 degrees take less than a hundredth off.
  const double exact_m2 = 2 * std::numbers::pi * 0.01 * (0.01 + 0.04);
  EXPECT_LT(area_m2, exact_m2);
  EXPECT_GT(area_m2, 0.99 * exact_m2);
}

TEST_F(StepShapeTest, APartWithoutTolerancesIsNoError) {
  const std::string path = WriteShape(BRepPrimAPI_MakeBox(10, 10, 10).Shape(), "plain.stp");
  const auto imported = ImportTolerances(path, Program());
  ASSERT_TRUE(imported.ok()) << imported.status();
  EXPECT_EQ(imported->report.entity_count, 0);
  EXPECT_THAT(imported->report.read, IsEmpty());
  EXPECT_THAT(imported->faces, SizeIs(6));
}

TEST_F(StepShapeTest, FailuresOfTheProgramAreTold) {
  const std::string box = WriteShape(BRepPrimAPI_MakeBox(10, 10, 10).Shape(), "box.stp");
  std::ofstream(PathOf("text.stp")) << "no STEP at all";
  std::ofstream(PathOf("part.stl")) << "solid";
  const auto garbage = ImportTolerances(PathOf("text.stp"), Program());
  EXPECT_EQ(garbage.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(garbage.status().message()),
              AllOf(HasSubstr("text.stp"), HasSubstr("not a STEP file")));
  EXPECT_EQ(ImportTolerances(PathOf("none.stp"), Program()).status().code(),
            absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(ImportTolerances(PathOf("part.stl"), Program()).status().message()),
              HasSubstr(".qif"));
  ToleranceImportOptions options = Program();
  options.time_limit = absl::Milliseconds(1);
  EXPECT_EQ(ImportTolerances(box, options).status().code(), absl::StatusCode::kDeadlineExceeded);
  options = {};
  options.step_import_program = PathOf("not_built");
  EXPECT_THAT(std::string(ImportTolerances(box, options).status().message()),
              AllOf(HasSubstr("not_built"), HasSubstr("sightline_step_import")));
  // Programs that fail otherwise: no JSON, another exit code.
  options.step_import_program = "/bin/echo";
  EXPECT_EQ(ImportTolerances(box, options).status().code(), absl::StatusCode::kInternal);
  options.step_import_program = "/bin/false";
  EXPECT_THAT(std::string(ImportTolerances(box, options).status().message()),
              HasSubstr("exit code 1"));
}

// Cut and flipped bytes of the entities: listed, refused, or read; numbers stay numbers.
TEST_F(StepShapeTest, DamagedEntitiesDoNotCrash) {
  const std::string path = WriteShape(BRepPrimAPI_MakeBox(10, 10, 10).Shape(), "box.stp");
  ToleranceEveryFace(Text(path), path);
  const std::string good = Text(path);
  const size_t from = good.find("#800000");
  std::mt19937 random(17);
  std::uniform_int_distribution<size_t> where(from, good.size() - 1);
  std::uniform_int_distribution<int> what(32, 126);
  int whole = 0, listed = 0, refused = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    std::string text = good;
    if (trial % 5 == 0) {
      text.resize(where(random));
    } else {
      for (int k = 0; k <= trial % 3; ++k) text[where(random)] = static_cast<char>(what(random));
    }
    try {
      const ToleranceReport report = ReadStepPmi(Part21File(text, "box.stp")).report;
      ExpectEverythingAccounted(report);
      for (const Tolerance& tolerance : report.read) {
        EXPECT_TRUE(std::isfinite(tolerance.zone_width_m) && tolerance.zone_width_m > 0);
      }
      ++(report.read.size() == 6 ? whole : listed);
    } catch (const StepInputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("box.stp"));
      ++refused;
    }
  }
  EXPECT_GT(whole, 0);
  EXPECT_GT(listed, 100);
  EXPECT_GT(refused, 100);
}

// --- Whole files
// ----------------------------------------------------------------------------------

fs::path SourceFolder() {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  return source != nullptr ? source : ".";
}

// Name, nominal value and zone width [mm, degrees]; 0: not looked at.
struct DrawnTolerance {
  const char* name;
  double nominal, width;
};

struct DrawnFile {
  fs::path path;
  size_t read, untoleranced, datums, not_read;
  std::vector<DrawnTolerance> tolerances;  // all that are read; empty: not stated
};

// The plate of data/make_toleranced_plate.py, whose drawing stands there. The NIST models too where
// they lie beside the tree: counts as by `grep` on the types of their entities; values of the first
// as in QIF, which another program (MBDVidia) exported for the DMSC (qif-community,
// samples/NISTmodels/nist_ctc_01_asme1_ap242.qif).
std::vector<DrawnFile> DrawnFiles() {
  std::vector<DrawnFile> files = {{SourceFolder() / "tests/tools/data/toleranced_plate.stp",
                                   8,
                                   1,
                                   3,
                                   1,
                                   {{"Flatness of A", 0, 0.05},
                                    {"Parallelism of the top", 0, 0.08},
                                    {"Squareness of B", 0, 0.1},
                                    {"Profile of the end", 0, 0.5},
                                    {"Position of the holes", 0, 0.2},
                                    {"diameter", 8, 0.022},
                                    {"thickness", 12, 0.2},
                                    {"slant", 60, 2}}}};
  const fs::path nist = SourceFolder() / "../shared/data/cad/nist_ap242";
  for (const DrawnFile& file :
       {DrawnFile{nist / "nist_ctc_01_asme1_ap242-e1.stp",
                  14,
                  0,
                  3,
                  4,
                  {{"Position.1", 0, 0.75},
                   {"Position.2", 0, 0.75},
                   {"Position surfacic profile.3", 0, 1.25},
                   {"Position surfacic profile.2", 0, 0.5},
                   {"Perpendicularity.1", 0, 1.5},
                   {"Flatness.1", 0, 0.2},
                   {"Linear Size.1", 35, 0.2},
                   {"Linear Size.2", 35, 0.2},
                   {"Linear Size.3", 20, 0.15},
                   {"Linear Size.4", 20, 0.15},
                   {"Linear Size.7", 35, 0.4},
                   {"Linear Size.8", 35, 0.4},
                   {"Angular Size.1", 60, 1},
                   {"Linear Size.9", 25, 0.3}}},
        DrawnFile{nist / "nist_ctc_03_asme1_ap242-e2.stp", 21, 1, 6, 1, {}},
        DrawnFile{nist / "nist_ctc_05_asme1_ap242-e1.stp", 12, 4, 6, 0, {}},
        DrawnFile{nist / "nist_ftc_06_asme1_ap242-e2.stp", 47, 5, 16, 0, {}}}) {
    if (fs::exists(file.path)) files.push_back(file);
  }
  return files;
}

class DrawnFileTest : public ::testing::TestWithParam<DrawnFile> {};
class DrawnValuesTest : public DrawnFileTest {};

// The others are large.
std::vector<DrawnFile> FilesWithValues() {
  std::vector<DrawnFile> files = DrawnFiles();
  std::erase_if(files, [](const DrawnFile& file) { return file.tolerances.empty(); });
  return files;
}

std::string NameOfFile(const ::testing::TestParamInfo<DrawnFile>& info) {
  std::string name = info.param.path.stem().string();
  std::ranges::replace_if(
      name, [](char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

TEST_P(DrawnFileTest, EverythingIsReadOrListed) {
  const auto imported = ImportTolerances(GetParam().path.string(), Program());
  ASSERT_TRUE(imported.ok()) << imported.status();
  const ToleranceReport& report = imported->report;
  ExpectEverythingAccounted(report);
  EXPECT_THAT(report.read, SizeIs(GetParam().read)) << Reasons(report);
  EXPECT_THAT(report.untoleranced, SizeIs(GetParam().untoleranced));
  EXPECT_THAT(report.datums, SizeIs(GetParam().datums));
  EXPECT_THAT(report.not_read, SizeIs(GetParam().not_read)) << Reasons(report);
  // OpenCASCADE has nothing that differs.
  EXPECT_THAT(report.notes, Not(Contains(HasSubstr("check it"))));
  EXPECT_THAT(report.notes, Not(Contains(HasSubstr("the former is used"))));
  for (const Tolerance& tolerance : report.read) {
    const bool angle = IsAngular(tolerance.kind);
    EXPECT_EQ(CheckTolerance(tolerance, 2).ok(), !angle) << tolerance.text;
    for (const int face : tolerance.faces) {
      EXPECT_LE(static_cast<size_t>(face), imported->faces.size());
    }
  }
}

TEST_P(DrawnValuesTest, ValuesAreThoseOfTheDrawing) {
  const ToleranceReport report = ReadStepPmi(Part21File::Read(GetParam().path)).report;
  EXPECT_EQ(report.read.size(), GetParam().tolerances.size());
  for (const DrawnTolerance& e : GetParam().tolerances) {
    const auto found = std::find_if(report.read.begin(), report.read.end(), [&](const auto& t) {
      return t.name == e.name || t.name.starts_with(std::string(e.name) + " (");
    });
    ASSERT_NE(found, report.read.end()) << e.name;
    const double degrees = 180 / std::numbers::pi;
    const bool angle = IsAngular(found->kind);
    EXPECT_NEAR(angle ? degrees * found->zone_width_rad : 1e3 * found->zone_width_m, e.width, 1e-9)
        << e.name;
    if (e.nominal > 0) {
      EXPECT_NEAR(angle ? degrees * found->nominal_rad.value() : 1e3 * found->nominal_m.value(),
                  e.nominal, 1e-9)
          << e.name;
    }
  }
}

// A GLB of the same STEP file, twice as coarse: every triangle lies on one of the faces.
TEST_P(DrawnValuesTest, PointsOfAnotherMeshFindTheirFaces) {
  const fs::path& path = GetParam().path;
  const auto imported = ImportTolerances(path.string(), Program());
  ASSERT_TRUE(imported.ok()) << imported.status();
  const StepModel model = ReadStep(path);
  const fs::path glb = fs::path(::testing::TempDir()) / "nist_faces_test.glb";
  ShapeMesh coarse = MeshShape(model.bodies.at(0).shape, {0.1, 15});
  WriteGlb({coarse}, {}, glb);
  const auto mesh = LoadPart(glb.string(), "");
  fs::remove(glb);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  std::vector<FaceSurface> faces;
  for (const FaceTriangles& face : imported->faces) {
    auto surface = FaceSurface::Make(face);
    ASSERT_TRUE(surface.ok()) << surface.status();
    faces.push_back(*std::move(surface));
  }
  std::vector<Vector3d> points, normals;
  double area_m2 = 0, left_out_m2 = 0;
  for (size_t t = 0; t < mesh->triangles.size(); ++t) {
    const Vector3d a = mesh->Corner(t, 0), b = mesh->Corner(t, 1), c = mesh->Corner(t, 2);
    // The file has floats, rounded to 3e-8 m at 0.4 m: slivers no higher have no normal to speak
    // of.
    const double longest_m = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
    area_m2 += mesh->Area(t);
    if (2 * mesh->Area(t) / longest_m < 6e-8) {
      left_out_m2 += mesh->Area(t);
      continue;
    }
    points.push_back((a + b + c) / 3);
    normals.push_back((b - a).cross(c - a));
  }
  EXPECT_LT(left_out_m2, 1e-9 * area_m2);
  EXPECT_THAT(PointsOnFaces(faces, points, normals), SizeIs(points.size()));
  // Datum A has no other plane: all points of its flat faces are in the plane z = 0.
  const auto datum = std::find_if(imported->report.datums.begin(), imported->report.datums.end(),
                                  [](const Datum& d) { return d.letter == "A"; });
  ASSERT_NE(datum, imported->report.datums.end());
  const auto on =
      PointsOnFaces({&faces.at(static_cast<size_t>(datum->faces.at(0) - 1)), 1}, points, normals);
  EXPECT_THAT(on, Not(IsEmpty()));
  for (const int i : on) EXPECT_NEAR(points[static_cast<size_t>(i)].z(), 0, 2e-4);
}

INSTANTIATE_TEST_SUITE_P(Files, DrawnFileTest, ::testing::ValuesIn(DrawnFiles()), NameOfFile);
INSTANTIATE_TEST_SUITE_P(Files, DrawnValuesTest, ::testing::ValuesIn(FilesWithValues()),
                         NameOfFile);

TEST(DrawnPlateTest, TolerancesBindTheFacesTheyAreDrawnAt) {
  const auto imported = ImportTolerances(DrawnFiles()[0].path.string(), Program());
  ASSERT_TRUE(imported.ok()) << imported.status();
  std::map<std::string, const Tolerance*> by_name;
  for (const Tolerance& tolerance : imported->report.read) by_name[tolerance.name] = &tolerance;
  // The middle of each face [mm]; of the holes both.
  const auto middles = [&](const std::string& name) {
    std::vector<Vector3d> found;
    for (const int face : by_name.at(name)->faces) {
      Eigen::AlignedBox3d box;
      for (const Vector3d& p : imported->faces.at(static_cast<size_t>(face - 1)).positions_m) {
        box.extend(1e3 * p);
      }
      found.push_back(box.center());
    }
    return found;
  };
  const auto expect_near = [&](const std::string& name, const std::vector<Vector3d>& expected) {
    const std::vector<Vector3d> found = middles(name);
    ASSERT_THAT(found, SizeIs(expected.size())) << name;
    for (size_t k = 0; k < found.size(); ++k) {
      EXPECT_LT((found[k] - expected[k]).norm(), 0.1) << name << ": " << found[k].transpose();
    }
  };
  const double end_mm = 60 + 12 * std::tan(std::numbers::pi / 6);
  expect_near("Flatness of A", {{end_mm / 2, 20, 0}});
  expect_near("Parallelism of the top", {{30, 20, 12}});
  expect_near("Squareness of B", {{end_mm / 2, 0, 6}});
  expect_near("Profile of the end", {{(60 + end_mm) / 2, 20, 6}});
  expect_near("Position of the holes", {{15, 20, 6}, {45, 20, 6}});
  expect_near("diameter", {{15, 20, 6}, {45, 20, 6}});
  EXPECT_EQ(by_name.at("Position of the holes")->text,
            "position diameter 0.2 mm maximum material requirement | A | B | C");
  EXPECT_EQ(by_name.at("diameter")->text, "diameter 8 +0.022/0 mm");
  ASSERT_THAT(imported->report.not_read, SizeIs(1));
  EXPECT_THAT(imported->report.not_read[0].reason, HasSubstr("tolerance class h9"));
}

}  // namespace
}  // namespace sightline
