// SPDX-License-Identifier: Apache-2.0
// Every STEP file of a task for which no unit is stated, wherever the task names it.
#include "planning_service/task/step_units.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>

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
  return CheckStepUnits(task, [files](const std::string& name, const auto& take) {
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

TEST(StepUnits, AFileThatStatesNoneIsRefusedAtItsField) {
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

TEST(StepUnits, AStatedUnitAndOtherFilesAreTaken) {
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
TEST(StepUnits, ReadsNoMoreThanItNeeds) {
  size_t bytes = 0;
  v1::PlanningTask task;
  task.mutable_inspection()->mutable_part()->set_file("large.stp");
  task.mutable_inspection()->add_obstacles()->set_file("large.stp");
  int reads = 0;
  const absl::Status status = CheckStepUnits(task, [&](const std::string&, const auto& take) {
    ++reads;
    std::string piece = kWithUnit;
    while (bytes < (size_t{1} << 30)) {
      bytes += piece.size();
      if (!take(piece)) break;
    }
    return absl::OkStatus();
  });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(reads, 1);
  EXPECT_EQ(bytes, std::string(kWithUnit).size());
}

TEST(StepUnits, AFileThatIsTooLargeIsLeftToTheImporter) {
  v1::PlanningTask task;
  task.mutable_inspection()->mutable_part()->set_file("large.stp");
  size_t bytes = 0;
  const absl::Status status = CheckStepUnits(task, [&](const std::string&, const auto& take) {
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

}  // namespace
}  // namespace sightline
