// SPDX-License-Identifier: Apache-2.0
#include "planning_service/task/planning_task.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "planning_service/task/option_fields.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

v1::PlanningTask Task(const std::string& json) {
  v1::PlanningTask task;
  const absl::Status parsed = ParseStrictJson(json, "task", &task);
  EXPECT_TRUE(parsed.ok()) << parsed;
  return task;
}

// Files that came with a task, by name.
using Files = std::map<std::string, std::string>;

absl::Status Check(const std::string& json, const Files& files) {
  std::vector<std::string> names;
  for (const auto& [name, bytes] : files) names.push_back(name);
  return CheckTask(Task(json), names, [&](const std::string& name) -> absl::StatusOr<std::string> {
    const auto file = files.find(name);
    if (file == files.end()) return absl::NotFoundError(name);
    return file->second;
  });
}

std::string FieldOf(const absl::Status& status) {
  const auto violations = FieldViolations(status);
  return violations.empty() ? "" : violations[0].field;
}

constexpr char kPlan[] =
    R"({"kind": "plan", "inspection": {"part": {"file": "part.stl", "unit": "mm"}}})";

TEST(PlanningTask, APlanNeedsItsPart) {
  EXPECT_TRUE(Check(kPlan, {{"part.stl", "solid"}}).ok());
  const absl::Status missing = Check(kPlan, {{"other.stl", "solid"}});
  EXPECT_TRUE(absl::IsNotFound(missing)) << missing;
  EXPECT_EQ(ErrorReason(missing), "FILE_UNKNOWN");
  EXPECT_EQ(ErrorMetadata(missing)["field"], "inspection.part.file");
}

TEST(PlanningTask, FilesDoNotCollideWithThoseOfTheService) {
  for (const char* name : {"inspection.json", "inspection.json/x", "plan.json/a/b"}) {
    EXPECT_EQ(FieldOf(Check(kPlan, {{"part.stl", "solid"}, {name, ""}})).substr(0, 6), "files[")
        << name;
  }
  EXPECT_TRUE(Check(kPlan, {{"part.stl", "solid"}, {"more/inspection.json", ""}}).ok());
}

// A real number anywhere in a task: in its plan, options, or inspection.
TEST(PlanningTask, NumbersAreFinite) {
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    v1::PlanningTask task = Task(kPlan);
    const auto check = [&] {
      return CheckTask(task, {"part.stl"},
                       [](const std::string&) -> absl::StatusOr<std::string> { return "solid"; });
    };
    ASSERT_TRUE(check().ok()) << check();
    task.mutable_plan()->add_scans();
    task.mutable_plan()->add_scans()->add_trigger_positions_m(bad);
    EXPECT_EQ(FieldOf(check()), "plan.scans[1].trigger_positions_m[0]");
    task.clear_plan();
    task.mutable_inspection()->mutable_goal()->set_coverage(bad);
    EXPECT_EQ(FieldOf(check()), "inspection.goal.coverage");
  }
}

TEST(PlanningTask, KindsSayWhatTheyTake) {
  EXPECT_EQ(FieldOf(Check(R"({"kind": "paln"})", {})), "kind");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "plan"})", {})), "inspection");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "verify"})", {})), "recordings");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "evaluate", "inspection": {"part": {"file": "p.stl"}}})",
                          {{"p.stl", ""}})),
            "plan");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "plan", "inspection": {"part": {"file": "p.glb"}},
                              "render_options": {"layers": true}})",
                          {{"p.glb", ""}})),
            "render_options");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "render"})", {})), "inspection");
}

// A task of kind inspect with these fields of inspect_options.
std::string InspectTask(const std::string& options) {
  return absl::StrCat(R"({"kind": "inspect", "inspection": {"part": {"file": "p.glb"}},
                          "plan": {"scans": [{}]}, "inspect_options": {)",
                      options, "}}");
}

TEST(PlanningTask, AcceptanceTestsTakeAnInspectionAlone) {
  const Files files = {{"p.glb", ""}};
  const std::string given = R"({"kind": "accept", "inspection": {"part": {"file": "p.glb"}})";
  EXPECT_TRUE(Check(given + R"(, "accept_options": {"no_images": true}})", files).ok());
  EXPECT_EQ(FieldOf(Check(given + R"(, "plan": {"scans": [{}]}})", files)), "plan");
  EXPECT_EQ(FieldOf(Check(given + R"(, "plan_options": {}})", files)), "plan_options");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "accept"})", {})), "inspection");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "accept", "inspection": {"part": {"file": "p.glb"},
                              "acceptance": {"runs": 1}}})",
                          files)),
            "inspection.acceptance.runs");
}

TEST(PlanningTask, MeasuredPointsAreJudged) {
  const Files files = {{"p.glb", ""}, {"scans/scan_01.ply", ""}, {"pose.txt", ""}};
  const std::string measured = R"("measured": [{"file": "scans/scan_01.ply"}])";
  EXPECT_TRUE(Check(InspectTask(measured), files).ok()) << Check(InspectTask(measured), files);
  const auto field_of = [&](const std::string& options) {
    return FieldOf(Check(InspectTask(options), files));
  };
  EXPECT_EQ(field_of(""), "inspect_options.measured");
  EXPECT_EQ(field_of(R"("measured": [{}])"), "inspect_options.measured[0].file");
  EXPECT_EQ(field_of(R"("measured": [{"file": "../x.ply"}])"), "inspect_options.measured[0].file");
  EXPECT_EQ(ErrorReason(Check(InspectTask(R"("measured": [{"file": "gone.ply"}])"), files)),
            "FILE_UNKNOWN");
  EXPECT_EQ(ErrorReason(Check(InspectTask(measured + R"(, "pose_file": "gone.txt")"), files)),
            "FILE_UNKNOWN");
  EXPECT_EQ(field_of(measured + R"(, "measured_unit": "miles")"), "inspect_options.measured_unit");
  EXPECT_EQ(field_of(measured + R"(, "pose_prior_m": 5)"), "inspect_options.pose_prior_m");
  EXPECT_EQ(field_of(measured + R"(, "tolerated_distance_m": 2)"),
            "inspect_options.tolerated_distance_m");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "inspect", "inspection": {"part": {"file": "p.glb"}},
                              "inspect_options": {"measured": [{"file": "pose.txt"}]}})",
                          files)),
            "plan");
}

TEST(PlanningTask, LengthsOfInspectOptionsAreMillimetresOfTheCommand) {
  const v1::PlanningTask task = Task(InspectTask(
      R"("measured": [{"file": "a/scan_01.ply"}, {"file": "a/scan_02.ply"}], "pose_file": "-p.txt",
         "measured_unit": "millimetre", "pose_prior_m": 0.004, "pose_prior_deg": 2,
         "tolerated_distance_m": 0.0015, "no_next_scan": true, "evaluations_per_scan": 70)"));
  const TaskCommands commands = SplitTask(task, "out", "checkpoint", 8);
  EXPECT_TRUE(commands.parts.empty());
  EXPECT_THAT(
      commands.conclusion,
      ElementsAre("inspect", "inspection.json", "--out=out", "--plan=plan.json",
                  "--measured=a/scan_01.ply", "--measured=a/scan_02.ply", "--measured-unit=mm",
                  "--pose=-p.txt", "--pose-prior-mm=4", "--pose-prior-deg=2",
                  "--tolerated-distance-mm=1.5", "--no-next-scan", "--evaluations-per-scan=70"));
}

TEST(PlanningTask, ValuesAreCheckedWhereTheyStand) {
  const absl::Status wrong = Check(
      R"({"kind": "plan", "inspection": {"part": {"file": "part.stl", "unit": "mm"},
          "camera": {"columns_px": 0, "rows_px": 100, "vertical_fov_deg": 30}}})",
      {{"part.stl", "solid"}});
  EXPECT_EQ(FieldOf(wrong), "inspection.camera.columns_px") << wrong;
  EXPECT_EQ(FieldOf(Check(R"({"kind": "plan", "inspection": {"part": {"file": "p.glb"}},
                              "plan_options": {"goal": 1.5}})",
                          {{"p.glb", ""}})),
            "plan_options.goal");
}

// A request can name its own files only.
TEST(PlanningTask, NoNameLeavesTheTask) {
  for (const std::string name :
       {"/etc/passwd", "../part.stl", "a/../../part.stl", "./part.stl", "a//part.stl",
        "a\\part.stl", "part.stl/", "", "a/..", "inspection.json", "plan.json"}) {
    EXPECT_FALSE(CheckFileName(name).ok()) << name;
  }
  EXPECT_FALSE(CheckFileName(std::string("a\0b", 3)).ok());
  EXPECT_FALSE(CheckFileName(std::string(300, 'a')).ok());
  for (const std::string name : {"part.stl", "materials/steel.json", "Teil äöü 1.glb", "..part"}) {
    EXPECT_TRUE(CheckFileName(name).ok()) << name;
  }
  EXPECT_EQ(FieldOf(Check(R"({"kind": "plan", "inspection": {"part": {"file": "/etc/passwd"}}})",
                          {{"part.stl", ""}})),
            "inspection.part.file");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "plan", "inspection": {"part": {"file": "part.glb"},
                              "tolerances": {"file": "../secret.stp"}}})",
                          {{"part.glb", ""}})),
            "inspection.tolerances.file");
}

// A step "." leads nowhere else: commands take such names, and so does the service.
TEST(PlanningTask, NamesWithDotStepsAreThoseOfTheFiles) {
  v1::PlanningTask task = Task(R"({"kind": "render", "inspection": {
      "part": {"file": "./part.stl", "unit": "mm"}, "obstacles": [{"file": "a/./b.stl"}],
      "camera": {"sensor_file": "././camera.json"}, "tolerances": {"file": "../x.stp"}}})");
  NormaliseFileNames(&task);
  const v1::Inspection& inspection = task.inspection();
  EXPECT_EQ(inspection.part().file(), "part.stl");
  EXPECT_EQ(inspection.obstacles(0).file(), "a/b.stl");
  EXPECT_EQ(inspection.camera().sensor_file(), "camera.json");
  EXPECT_EQ(inspection.tolerances().file(), "../x.stp");
}

TEST(PlanningTask, ADamagedDigestOfItsPlanIsRefused) {
  const auto check = [](const std::string& digest) {
    return Check(R"({"kind": "evaluate", "plan": {"part_digest": ")" + digest +
                     R"("}, "inspection": {"part": {"file": "part.stl", "unit": "mm"}}})",
                 {{"part.stl", "solid"}});
  };
  EXPECT_TRUE(check("2:" + std::string(64, 'a')).ok()) << check("2:" + std::string(64, 'a'));
  for (const std::string& bad :
       {std::string("abc"), "2:" + std::string(63, 'a'), "x:" + std::string(64, 'a')}) {
    EXPECT_EQ(FieldOf(check(bad)), "plan.part_digest") << bad;
  }
}

// Every option that is written into a command line is given back as its field, and clients read no
// option of a command that they do not call.
TEST(PlanningTask, WhatCommandsSayNamesFields) {
  for (const std::string& kind : TaskKinds()) {
    for (const OptionField& entry : OptionFields(kind)) {
      EXPECT_EQ(OptionOf(kind, entry.field), entry.option);
      EXPECT_EQ(WithFieldNames(kind, std::string(entry.option) + ": is wrong"),
                std::string(entry.field) + ": is wrong");
      EXPECT_EQ(WithFieldNames(kind, "x (" + std::string(entry.option) + "=3)"),
                "x (" + std::string(entry.field) + "=3)");
    }
  }
  EXPECT_EQ(WithFieldNames("plan", "part.stp: --unit must be left out"),
            "part.stp: inspection.part.unit must be left out");
  EXPECT_EQ(WithFieldNames("plan", "state part.unit (--unit of `sightline part`): m, cm (or mm)"),
            "state part.unit: m, cm (or mm)");
  for (const char* other : {"a--b", "file--unit.stl", "--unknown-option", "-- x", "1 --", ""}) {
    EXPECT_EQ(WithFieldNames("plan", other), other);
  }
}

// A material file names further files: these count as well.
TEST(PlanningTask, FilesNamedInFilesAreChecked) {
  const std::string task = R"({"kind": "render", "inspection": {"part": {"file": "part.glb"},
      "materials": [{"file": "materials/metal.json"}]}})";
  const auto material = [](const std::string& table) {
    return R"({"name": "metal", "conductor": {"refractive_index_file": ")" + table +
           R"(", "ggx_alpha_x": 0.2}})";
  };
  Files files = {
      {"part.glb", ""}, {"materials/metal.json", material("iron.csv")}, {"materials/iron.csv", ""}};
  absl::Status good = Check(task, files);
  EXPECT_EQ(ErrorReason(good), "") << good;
  EXPECT_THAT(std::string(good.message()), testing::Not(HasSubstr("iron.csv"))) << good;
  for (const std::string table :
       {"/etc/passwd", "../../secret.csv", "../part2.csv", "missing.csv"}) {
    files["materials/metal.json"] = material(table);
    const absl::Status wrong = Check(task, files);
    EXPECT_FALSE(wrong.ok()) << table;
    EXPECT_TRUE(ErrorReason(wrong) == "FILE_UNKNOWN" || ErrorReason(wrong) == "INVALID_FIELD")
        << wrong;
    EXPECT_THAT(std::string(wrong.message()), testing::Not(HasSubstr("sightline-task"))) << wrong;
  }
}

// Every field that can hold a file name must be found, also in messages that come later.
TEST(PlanningTask, EveryFileFieldOfAnInspectionIsSeen) {
  v1::PlanningTask task = Task(R"({"kind": "render", "inspection": {"part": {"file": "part.glb"},
      "obstacles": [{"file": "no/such.stl", "unit": "mm"}]}})");
  const auto check = [&] {
    return CheckTask(task, {"part.glb"}, [](const std::string&) -> absl::StatusOr<std::string> {
      return absl::NotFoundError("");
    });
  };
  EXPECT_EQ(ErrorMetadata(check())["field"], "inspection.obstacles[0].file");
  task.mutable_inspection()->clear_obstacles();
  task.mutable_inspection()
      ->add_materials()
      ->mutable_material()
      ->mutable_conductor()
      ->set_refractive_index_file("no/such.csv");
  EXPECT_EQ(ErrorMetadata(check())["field"],
            "inspection.materials[0].material.conductor.refractive_index_file");
  task.mutable_inspection()->clear_materials();
  task.mutable_inspection()->mutable_camera()->set_sensor_file("no/such.json");
  EXPECT_EQ(ErrorMetadata(check())["field"], "inspection.camera.sensor_file");
}

TEST(PlanningTask, AFileIsNotAFolderToo) {
  EXPECT_EQ(FieldOf(Check(kPlan, {{"part.stl", ""}, {"part.stl/x", ""}})), "files");
}

TEST(PlanningTask, FingerprintTellsQuestionsApart) {
  const v1::PlanningTask task = Task(kPlan);
  const JobFile part{"part.stl", std::string(64, 'a'), 10};
  const JobFile other{"part.stl", std::string(64, 'b'), 10};
  const std::string fingerprint = TaskFingerprint(task, {part});
  EXPECT_EQ(fingerprint.size(), 64u);
  EXPECT_EQ(TaskFingerprint(Task(kPlan), {part}), fingerprint);
  EXPECT_NE(TaskFingerprint(task, {other}), fingerprint);
  v1::PlanningTask seeded = task;
  seeded.set_seed(2);
  EXPECT_NE(TaskFingerprint(seeded, {part}), fingerprint);
  const JobFile second{"b.stl", std::string(64, 'c'), 1};
  EXPECT_EQ(TaskFingerprint(task, {part, second}), TaskFingerprint(task, {second, part}));
}

TEST(PlanningTask, ArgumentsAreTheCommands) {
  v1::PlanningTask task = Task(kPlan);
  task.set_seed(-7);
  task.mutable_plan_options()->set_goal(0.9);
  EXPECT_THAT(SplitTask(task, "../out", "../checkpoint", 1).conclusion,
              ElementsAre("plan", "inspection.json", "--out=../out", "--seed=-7",
                          "--checkpoint=../checkpoint", "--goal=0.9"));
  v1::PlanningTask verify;
  verify.set_kind("verify");
  verify.mutable_recordings();
  EXPECT_THAT(SplitTask(verify, "../out", "../checkpoint", 1).conclusion,
              ElementsAre("verify", "recordings.json", "--out=../out"));
  const v1::PlanningTask accept =
      Task(R"({"kind": "accept", "inspection": {"part": {"file": "p.glb"}},
                              "accept_options": {"no_images": true}, "seed": 5})");
  EXPECT_THAT(SplitTask(accept, "../out", "../checkpoint", 1).conclusion,
              ElementsAre("accept", "inspection.json", "--out=../out", "--seed=5", "--no-images"));
  v1::PlanningTask optics = Task(R"({"kind": "optics", "plan_job_id": "job-1",
      "inspection": {"part": {"file": "p.glb"}}, "optics_options": {"scan": 2}})");
  EXPECT_THAT(SplitTask(optics, "../out", "../checkpoint", 1).conclusion,
              Contains("--plan=plan.json"));
  EXPECT_THAT(SplitTask(optics, "../out", "../checkpoint", 1).conclusion, Contains("--scan=2"));
}

// Every kind that takes a plan is tried, with the plan in the task and as that of a job.
TEST(PlanningTask, APlanOfAnotherPartIsTakenOnRequest) {
  const Files files = {{"p.glb", ""}};
  for (const std::string kind : {"evaluate", "optics", "render"}) {
    for (const std::string plan : {R"("plan": {"scans": [{}]})", R"("plan_job_id": "job-1")"}) {
      const auto json = [&](const std::string& more) {
        return R"({"kind": ")" + kind + R"(", "inspection": {"part": {"file": "p.glb"}}, )" + plan +
               more + "}";
      };
      EXPECT_NE(FieldOf(Check(json(R"(, "other_part": true)"), files)), "other_part") << kind;
      EXPECT_THAT(
          SplitTask(Task(json(R"(, "other_part": true)")), "../out", "../kept", 1).conclusion,
          Contains("--other-part"));
      EXPECT_THAT(SplitTask(Task(json("")), "../out", "../kept", 1).conclusion,
                  testing::Not(Contains("--other-part")));
    }
  }
  // Without a plan there is nothing that could be of another part.
  EXPECT_EQ(FieldOf(Check(R"({"kind": "plan", "inspection": {"part": {"file": "p.glb"}},
                              "other_part": true})",
                          files)),
            "other_part");
  EXPECT_EQ(FieldOf(Check(R"({"kind": "optics", "inspection": {"part": {"file": "p.glb"}},
                              "other_part": true})",
                          files)),
            "other_part");
}

TEST(PlanningTask, RenderingsOfSeveralImagesSplit) {
  v1::PlanningTask task;
  task.set_kind("render");
  for (int i = 0; i < 3; ++i) task.mutable_recordings()->add_recordings();
  const TaskCommands whole = SplitTask(task, "../out", "../checkpoint", 1);
  EXPECT_TRUE(whole.parts.empty());
  // As many parts as are asked for, but none without an image.
  for (const auto& [asked, made] : {std::pair(2, 2u), std::pair(3, 3u), std::pair(100, 3u)}) {
    const TaskCommands split = SplitTask(task, "../out", "../checkpoint", asked);
    EXPECT_EQ(split.conclusion, whole.conclusion);
    ASSERT_EQ(split.parts.size(), made);
    for (size_t i = 0; i < made; ++i) {
      std::vector<std::string> expected = whole.conclusion;
      expected.push_back("--part=" + std::to_string(i + 1) + "/" + std::to_string(made));
      EXPECT_EQ(split.parts[i], expected);
    }
  }
  v1::PlanningTask one_frame = Task(R"({"kind": "render", "plan_job_id": "job-1",
      "inspection": {"part": {"file": "p.glb"}}, "render_options": {"frames": {"scan": 2}}})");
  EXPECT_EQ(SplitTask(one_frame, "../out", "../checkpoint", 4).parts.size(), 4u);
  one_frame.mutable_render_options()->mutable_frames()->set_frame(7);
  EXPECT_TRUE(SplitTask(one_frame, "../out", "../checkpoint", 4).parts.empty());
  EXPECT_TRUE(SplitTask(Task(kPlan), "../out", "../checkpoint", 4).parts.empty());
}

TEST(PlanningTask, StartsOfAPlanSplit) {
  v1::PlanningTask task = Task(kPlan);
  task.set_seed(5);
  task.mutable_plan_options()->set_starts(3);
  const TaskCommands whole = SplitTask(task, "../out", "../checkpoint", 1);
  EXPECT_TRUE(whole.parts.empty());
  EXPECT_THAT(whole.conclusion, ElementsAre("plan", "inspection.json", "--out=../out", "--seed=5",
                                            "--checkpoint=../checkpoint", "--starts=3"));
  for (const auto& [asked, made] : {std::pair(2, 2u), std::pair(3, 3u), std::pair(100, 3u)}) {
    const TaskCommands split = SplitTask(task, "../out", "../checkpoint", asked);
    EXPECT_EQ(split.conclusion, whole.conclusion);
    ASSERT_EQ(split.parts.size(), made);
    for (size_t i = 0; i < made; ++i) {
      std::vector<std::string> expected = whole.conclusion;
      expected.push_back("--part=" + std::to_string(i + 1) + "/" + std::to_string(made));
      EXPECT_EQ(split.parts[i], expected);
    }
  }
  task.mutable_plan_options()->set_starts(1);
  EXPECT_TRUE(SplitTask(task, "../out", "../checkpoint", 4).parts.empty());
  for (const int wrong : {0, -1, 1001}) {
    task.mutable_plan_options()->set_starts(wrong);
    EXPECT_EQ(FieldOf(CheckTask(
                  task, {"part.stl"},
                  [](const std::string&) -> absl::StatusOr<std::string> { return std::string(); })),
              "plan_options.starts");
  }
}

TEST(PlanningTask, AnOptionIsNoWayIn) {
  v1::PlanningTask task = Task(kPlan);
  task.mutable_plan_options()->set_strategy("--coverage-server=evil:1");
  EXPECT_EQ(FieldOf(CheckTask(
                task, {"part.stl"},
                [](const std::string&) -> absl::StatusOr<std::string> { return std::string(); })),
            "plan_options.strategy");
}

}  // namespace
}  // namespace sightline
