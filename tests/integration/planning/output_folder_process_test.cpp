// SPDX-License-Identifier: Apache-2.0
// Files that `sightline` leaves in its output folder, and files that it does not read, as
// processes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <string>

#include "core/file/file_lock.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kOutputFolderInspection[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"}, "targets": {"spacing_m": 0.004}
})";

class OutputFolderTest : public BoxProcessTest {
 protected:
  OutputFolderTest() : BoxProcessTest(kOutputFolderInspection) {}

  std::pair<int, std::string> Plan(const std::string& options) const {
    return Run(
        absl::StrCat("plan inspection.json --out a --evaluations-per-scan 300 "
                     "--bound-evaluations 0 --no-pictures --no-fresh-targets "
                     "--field-directions 256 --goal 1 ",
                     options));
  }
  bool Has(const std::string& file) const { return fs::exists(folder_ + "/" + file); }
};

TEST_F(OutputFolderTest, NothingStaysOfThePlanBefore) {
  auto [code, output] = Plan("--max-scans 2");
  ASSERT_EQ(code, 0) << output;
  ASSERT_EQ(Read<v1::Plan>("a/plan.json").scans_size(), 2);
  ASSERT_TRUE(Has("a/points/scan_02.ply"));
  // Files that the plan did not write belong to the user.
  Write("a/points/notes.txt", "mine");
  Write("a/points/scan_02_measured.ply", "mine");
  Write("a/optics.json", "{}");
  std::tie(code, output) = Plan("--max-scans 1");
  ASSERT_EQ(code, 0) << output;
  EXPECT_EQ(Read<v1::Plan>("a/plan.json").scans_size(), 1);
  EXPECT_TRUE(Has("a/points/scan_01.ply"));
  EXPECT_FALSE(Has("a/points/scan_02.ply"));
  EXPECT_FALSE(Has("a/optics.json"));
  EXPECT_TRUE(Has("a/points/notes.txt"));
  EXPECT_TRUE(Has("a/points/scan_02_measured.ply"));
  std::tie(code, output) = Plan("--max-scans 2 --resume --no-point-clouds");
  ASSERT_EQ(code, 0) << output;
  EXPECT_FALSE(Has("a/points/scan_01.ply"));
  EXPECT_TRUE(Has("a/report.html"));
  // Nothing of the lock or of trying whether the folder can be written to.
  for (const auto& entry : fs::directory_iterator(folder_ + "/a")) {
    EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path();
  }
}

TEST_F(OutputFolderTest, OneCommandAtATimeWritesThere) {
  fs::create_directories(folder_ + "/a");
  const auto lock = FileLock::TakeFolder(folder_ + "/a");
  ASSERT_TRUE(lock.ok()) << lock.status();
  const auto [code, output] = Plan("--max-scans 1");
  EXPECT_EQ(code, 1);
  EXPECT_THAT(output, HasSubstr("--out a: another sightline command is writing there"));
  EXPECT_FALSE(Has("a/plan.json"));
}

TEST_F(OutputFolderTest, ExploreHasItsFolderForItself) {
  const std::string explore =
      "explore inspection.json --listen 127.0.0.1:0 --field-directions 64 --out a";
  {
    fs::create_directories(folder_ + "/a");
    const auto lock = FileLock::TakeFolder(folder_ + "/a");
    ASSERT_TRUE(lock.ok()) << lock.status();
    const auto [code, output] = Run(explore);
    EXPECT_EQ(code, 1) << output;
    EXPECT_THAT(output, HasSubstr("another sightline command is writing there"));
  }
  const auto [code, output] =
      Run("explore inspection.json --listen 127.0.0.1:0 --out /proc/self/a");
  EXPECT_EQ(code, 2) << output;
  EXPECT_THAT(output, HasSubstr("cannot make folder /proc/self/a"));
  // And while it runs nobody else writes there.
  const std::string program = BinFolder() + "/sightline ";
  const ProcessResult both = RunProcess(absl::StrCat(
      "cd ", folder_, "; ", program, explore, " > page.log 2>&1 & page=$!; cd ", folder_,
      "; while kill -0 $page && ! grep -q ^page: page.log; do sleep 0.1; done; ", program,
      "plan inspection.json --out a --bound-evaluations 0 --no-pictures 2>&1; echo plan=$?; ",
      "kill -TERM $page; wait $page; echo explore=$?; cat page.log"));
  EXPECT_THAT(both.output, AllOf(HasSubstr("another sightline command is writing there"),
                                 HasSubstr("plan=1\n"), HasSubstr("page:   http://")));
  EXPECT_FALSE(Has("a/plan.json"));
}

TEST_F(OutputFolderTest, AFolderThatCannotBeWrittenToIsFoundFirst) {
  for (const char* out : {"inspection.json", "box.obj/a", "/proc/self/a"}) {
    const auto [code, output] =
        Run(absl::StrCat("plan inspection.json --bound-evaluations 0 --out ", out));
    EXPECT_EQ(code, 2) << output;
    EXPECT_THAT(output, HasSubstr(out));
    EXPECT_THAT(output, testing::Not(HasSubstr("part:"))) << "work was begun";
  }
}

TEST_F(OutputFolderTest, InputThatNeverEndsIsRefused) {
  ASSERT_EQ(mkfifo((folder_ + "/pipe.json").c_str(), 0600), 0);
  Write("pipe_part.json", R"({"part": {"file": "pipe.obj", "unit": "mm"}})");
  ASSERT_EQ(mkfifo((folder_ + "/pipe.obj").c_str(), 0600), 0);
  for (const char* input : {"pipe.json", "/dev/zero", "."}) {
    for (const char* command : {"plan", "render", "optics"}) {
      const auto [code, output] = Run(absl::StrCat(command, " ", input, " --out a"));
      EXPECT_EQ(code, 2) << command << " " << output;
      EXPECT_THAT(output, AllOf(HasSubstr(input), HasSubstr("file"))) << command;
    }
  }
  const auto [code, output] = Run("plan pipe_part.json --out a");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(output, HasSubstr("pipe.obj: is no regular file"));
  Write("keys.json", "{\"\\u001b[31mred\": 1}");
  const auto [keys_code, keys_output] = Run("plan keys.json --out a");
  EXPECT_EQ(keys_code, 2);
  EXPECT_THAT(keys_output, AllOf(HasSubstr("\\x1b[31mred"), testing::Not(HasSubstr("\x1b"))));
}

TEST_F(OutputFolderTest, PlanFilesHaveAtMostAThousandScans) {
  const auto plan_of = [](int scans) {
    std::string text = R"({"scans": [{"measurement": {"camera_distance_m": 99}})";
    for (int i = 1; i < scans; ++i) text += R"(, {"measurement": {}})";
    return text + "]}";
  };
  // As many as allowed are looked at: their first says something else is wrong.
  for (const auto& [scans, said] : {std::pair(1001, "scans has 1001 entries, at most 1000"),
                                    std::pair(1000, "scans[0].measurement.camera_distance_m")}) {
    Write("many.json", plan_of(scans));
    const auto [code, output] = Run("evaluate inspection.json many.json --out a");
    EXPECT_EQ(code, 2) << output;
    EXPECT_THAT(output, HasSubstr(said));
  }
}

// Memory for the program, not enough for the file.
TEST_F(OutputFolderTest, OutOfMemoryIsSaid) {
  Write("large.stl", "");
  std::filesystem::resize_file(absl::StrCat(folder_, "/large.stl"), 600'000'000);
  Write("large.json", R"({"part": {"file": "large.stl", "unit": "mm"}})");
  const ProcessResult result =
      RunProcess(absl::StrCat("cd ", folder_, " && (ulimit -v 400000; ", BinFolder(),
                              "/sightline plan large.json --out a)"));
  EXPECT_EQ(result.exit_code, 1) << result.output;
  EXPECT_THAT(result.output, HasSubstr("sightline: out of memory"));
}

}  // namespace
}  // namespace sightline
