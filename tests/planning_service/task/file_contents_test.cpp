// SPDX-License-Identifier: Apache-2.0
// Files of a task whose content contradicts the task, wherever the task names them.
#include "planning_service/task/file_contents.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_replace.h"
#include "core/json/strict_json.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

using testing::HasSubstr;

constexpr char kWithoutUnit[] =
    "ISO-10303-21;\nDATA;\n#1=(GEOMETRIC_REPRESENTATION_CONTEXT(3)REPRESENTATION_CONTEXT('',''));\n"
    "ENDSEC;\nEND-ISO-10303-21;\n";
constexpr char kWithUnit[] =
    "ISO-10303-21;\nDATA;\n#1=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#2)"
    ")"
    "REPRESENTATION_CONTEXT('',''));\n#2=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));\n"
    "ENDSEC;\nEND-ISO-10303-21;\n";

// Files of the task, and how often each was read.
struct Files {
  std::map<std::string, std::string> text;
  std::map<std::string, int> reads;
};

absl::Status Check(const std::string& json, Files* files) {
  v1::PlanningTask task;
  const absl::Status parsed = ParseStrictJson(json, "task", &task);
  EXPECT_TRUE(parsed.ok()) << parsed;
  std::vector<std::string> names;
  for (const auto& [name, text] : files->text) names.push_back(name);
  return CheckFileContents(task, names, [files](const std::string& name, const auto& take) {
    const auto file = files->text.find(name);
    if (file == files->text.end()) return absl::NotFoundError(name);
    ++files->reads[name];
    for (size_t at = 0; at < file->second.size() && take(file->second.substr(at, 10)); at += 10) {
    }
    return absl::OkStatus();
  });
}

std::string FieldOf(const std::string& json) {
  Files files = {{{"none.stp", kWithoutUnit}, {"mm.STEP", kWithUnit}, {"p.stl", kWithoutUnit}}, {}};
  const absl::Status status = Check(json, &files);
  if (status.ok()) return "";
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_EQ(ErrorReason(status), "INVALID_FIELD");
  EXPECT_THAT(FieldViolations(status)[0].description, HasSubstr("none.stp states no length unit"));
  return FieldViolations(status)[0].field;
}

TEST(FileContents, AFileThatStatesNoneIsRefusedAtItsField) {
  EXPECT_EQ(FieldOf(R"({"inspection": {"part": {"file": "none.stp"}}})"), "inspection.part.unit");
  EXPECT_EQ(FieldOf(R"({"inspection": {"part": {"file": "mm.STEP"},
                        "obstacles": [{"file": "mm.STEP"}, {"file": "none.stp"}]}})"),
            "inspection.obstacles[1].unit");
  EXPECT_EQ(FieldOf(R"({"inspection": {"part": {"file": "mm.STEP"},
                        "tolerances": {"file": "none.stp"}}})"),
            "inspection.tolerances.unit");
  EXPECT_EQ(FieldOf(R"({"diagnose_options": {"part_file": "none.stp"}})"),
            "diagnose_options.part_unit");
}

TEST(FileContents, AStatedUnitAndOtherFilesAreTaken) {
  for (const char* json : {
           R"({"inspection": {"part": {"file": "mm.STEP"}}})",
           R"({"inspection": {"part": {"file": "p.stl"}}})",
           R"({"inspection": {"part": {"file": "none.stp", "unit": "mm"},
                              "tolerances": {"file": "none.stp"}}})",
           R"({"inspection": {"part": {"file": "mm.STEP"},
                              "tolerances": {"file": "none.stp", "unit": "in"}}})",
           R"({"diagnose_options": {"part_file": "none.stp", "part_unit": "mm"}})",
           R"({"kind": "verify"})",
       }) {
    EXPECT_EQ(FieldOf(json), "") << json;
  }
}

// A unit at the beginning of a large file ends the pass over it, and no file is passed over twice.
TEST(FileContents, ReadsNoMoreThanItNeeds) {
  size_t bytes = 0;
  v1::PlanningTask task;
  task.mutable_inspection()->mutable_part()->set_file("large.stp");
  task.mutable_inspection()->add_obstacles()->set_file("large.stp");
  int reads = 0;
  const absl::Status status =
      CheckFileContents(task, {}, [&](const std::string&, const auto& take) {
        ++reads;
        std::string piece = kWithUnit;
        while (bytes < (size_t{1} << 30)) {
          bytes += piece.size();
          if (!take(piece)) break;
        }
        return absl::OkStatus();
      });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(reads, 3);  // once for each file whether it is empty
  EXPECT_EQ(bytes, 3 * std::string(kWithUnit).size());
}

TEST(FileContents, AFileThatIsTooLargeIsLeftToTheImporter) {
  v1::PlanningTask task;
  task.mutable_inspection()->mutable_part()->set_file("large.stp");
  size_t bytes = 0;
  const absl::Status status =
      CheckFileContents(task, {}, [&](const std::string&, const auto& take) {
        const std::string blank(size_t{1} << 20, '\n');
        bool wanted = take(kWithoutUnit);
        while (wanted) {
          wanted = take(blank);
          bytes += blank.size();
        }
        return absl::OkStatus();
      });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_LE(bytes, size_t{65} << 20);
}

// The first violation of a task with these files: its field, or its reason if it is about none.
std::string Refused(const std::string& json, std::map<std::string, std::string> text) {
  Files files = {std::move(text), {}};
  const absl::Status status = Check(json, &files);
  if (status.ok()) return "";
  const auto violations = FieldViolations(status);
  return violations.empty() ? ErrorReason(status) + " " + ErrorMetadata(status)["file"]
                            : violations[0].field;
}

TEST(FileContents, AUnitBesideThatOfTheFileIsRefused) {
  const std::string two_contexts =
      absl::StrReplaceAll(std::string(kWithUnit), {{"ENDSEC",
                                                    "#3=(GEOMETRIC_REPRESENTATION_CONTEXT(3)"
                                                    "REPRESENTATION_CONTEXT('',''));\nENDSEC"}});
  const std::string part = R"({"inspection": {"part": {"file": "a.stp", "unit": "mm"}}})";
  EXPECT_EQ(Refused(part, {{"a.stp", kWithUnit}}), "inspection.part.unit");
  EXPECT_EQ(Refused(part, {{"a.stp", kWithoutUnit}}), "");
  // The given unit is for shapes that have none.
  EXPECT_EQ(Refused(part, {{"a.stp", two_contexts}}), "");
}

TEST(FileContents, EmptyAndOtherFilesAreNamed) {
  const std::string part = R"({"inspection": {"part": {"file": "a.stp"}}})";
  EXPECT_EQ(Refused(part, {{"a.stp", ""}}), "inspection.part.file");
  EXPECT_EQ(Refused(part, {{"a.stp",
                            "\x7f"
                            "ELF#1=();"}}),
            "inspection.part.file");
  // Damage is for the importer to name: it knows more than this pass.
  EXPECT_EQ(Refused(part, {{"a.stp", absl::StrReplaceAll(std::string(kWithoutUnit),
                                                         {{"ENDSEC", "#5=A(#6);\nENDSEC"}})}}),
            "");
}

TEST(FileContents, BuffersOfGltfFilesAreEmbeddedOrCameWithTheTask) {
  const std::string part = R"({"inspection": {"part": {"file": "a/part.gltf"}}})";
  const auto gltf = [](const std::string& uris) {
    return R"({"images": [{"uri": "x.png"}], "buffers": [)" + uris +
           R"(], "extras": {"uri": "y"}})";
  };
  const std::string embedded = R"({"uri": "data:application/octet-stream;base64,AA=="})";
  EXPECT_EQ(Refused(part, {{"a/part.gltf", gltf(embedded)}}), "");
  EXPECT_EQ(Refused(part, {{"a/part.gltf", gltf(embedded + R"(, {"uri": "b%20c.bin"})")}}),
            "FILE_UNKNOWN a/b c.bin");
  EXPECT_EQ(Refused(part, {{"a/part.gltf", gltf(R"({"uri": "b%20c.bin"})")}, {"a/b c.bin", "x"}}),
            "");
  EXPECT_EQ(Refused(part, {{"a/part.gltf", "{"}}), "inspection.part.file");
}

TEST(FileContents, UnitsOfQifFilesAreThoseOfTheTaskOrTheFile) {
  const auto qif = [](const std::string& unit) {
    return R"(<?xml version="1.0"?><QIFDocument xmlns="http://qifstandards.org/xsd/qif3")"
           R"( versionQIF="3.0.0" idMax="9"><FileUnits><PrimaryUnits>)" +
           unit +
           R"(<AngularUnit><UnitName>deg</UnitName></AngularUnit></PrimaryUnits></FileUnits>)"
           R"(</QIFDocument>)";
  };
  const auto task = [](const std::string& unit) {
    return R"({"inspection": {"part": {"file": "p.glb"}, "tolerances": {"file": "t.qif", "unit": ")" +
           unit + R"("}}})";
  };
  const std::string mm = qif("<LinearUnit><UnitName>mm</UnitName></LinearUnit>");
  EXPECT_EQ(Refused(task(""), {{"p.glb", "x"}, {"t.qif", mm}}), "");
  EXPECT_EQ(Refused(task("mm"), {{"p.glb", "x"}, {"t.qif", mm}}), "inspection.tolerances.unit");
  EXPECT_EQ(Refused(task("mm"), {{"p.glb", "x"}, {"t.qif", qif("")}}), "");
  EXPECT_EQ(Refused(task(""), {{"p.glb", "x"}, {"t.qif", "<QIFDocument"}}),
            "inspection.tolerances.file");
}

}  // namespace
}  // namespace sightline
