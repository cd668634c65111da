// SPDX-License-Identifier: Apache-2.0
// STEP files through an importer that a script stands for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "planner_client/part_files/part_file.h"
#include "planner_client/part_files/step_mesh.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class StepMeshTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    options_.program.program = folder_ + "/importer";
    options_.cache_folder = folder_ + "/cache";
    std::ofstream(step_) << "ISO-10303-21;";
    // Counts its calls; what it makes is the file in capitals.
    MakeImporter("echo x >> " + folder_ + "/calls\nsleep 0.05\ntr a-z A-Z < \"$1\" > \"$3\"\n");
  }
  void TearDown() override {
    fs::remove_all(folder_);
    fs::remove(step_);
  }

  void MakeImporter(const std::string& script) {
    std::ofstream(options_.program.program) << "#!/bin/sh\n" << script;
    fs::permissions(options_.program.program, fs::perms::owner_all);
  }
  static std::string Text(const std::string& path) {
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  size_t Calls() const { return Text(folder_ + "/calls").size() / 2; }

  std::string folder_ = "/tmp/sightline-step-XXXXXX";
  StepMeshOptions options_;
  const std::string step_ = "/tmp/" + std::to_string(getpid()) + "-part.step";
};

TEST_F(StepMeshTest, IsMadeOnceUntilTheFileChanges) {
  const auto first = MeshOfStepFile(step_, options_);
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(fs::path(*first).extension(), ".glb");
  EXPECT_EQ(Text(*first), "ISO-10303-21;");
  EXPECT_EQ(*MeshOfStepFile(step_, options_), *first);
  EXPECT_EQ(Calls(), 1u);
  std::ofstream(step_) << "iso-10303-21; other";
  const auto other = MeshOfStepFile(step_, options_);
  ASSERT_TRUE(other.ok());
  EXPECT_NE(*other, *first);
  EXPECT_EQ(Text(*other), "ISO-10303-21; OTHER");
  EXPECT_EQ(Calls(), 2u);
  // Another importer may mesh otherwise.
  MakeImporter("echo new > \"$3\"\n# longer than before: ........................................");
  EXPECT_EQ(Text(*MeshOfStepFile(step_, options_)), "new\n");
}

TEST_F(StepMeshTest, IsMadeOnceForMany) {
  std::vector<std::jthread> threads;
  std::vector<std::string> meshes(8);
  for (std::string& mesh : meshes) {
    threads.emplace_back([&] { mesh = *MeshOfStepFile(step_, options_); });
  }
  threads.clear();
  for (const std::string& mesh : meshes) EXPECT_EQ(mesh, meshes.front());
  EXPECT_EQ(Calls(), 1u);
}

TEST_F(StepMeshTest, FailuresLeaveNothingBehind) {
  MakeImporter(
      "echo half > \"$3\"; echo 'sightline_step_import: a.step: is no STEP file' >&2\nexit 2\n");
  const absl::Status wrong = MeshOfStepFile(step_, options_).status();
  EXPECT_EQ(wrong.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(wrong.message(), "a.step: is no STEP file");
  for (const auto& entry : fs::directory_iterator(options_.cache_folder)) {
    EXPECT_EQ(entry.path().extension(), ".lock");
  }
  options_.program.time_limit = absl::Milliseconds(100);
  MakeImporter("exec sleep 60\n");
  EXPECT_EQ(MeshOfStepFile(step_, options_).status().code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_EQ(MeshOfStepFile(folder_ + "/none.step", options_).status().code(),
            absl::StatusCode::kNotFound);
}

TEST_F(StepMeshTest, WithoutImporterThePackageIsNamed) {
  options_.program.program = folder_ + "/not_there";
  const absl::Status missing = MeshOfStepFile(step_, options_).status();
  EXPECT_EQ(missing.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(missing.message()),
              AllOf(HasSubstr(step_), HasSubstr("sightline-step-import"), HasSubstr("not_there")));
}

TEST_F(StepMeshTest, MeshesThatNobodyAskedForGo) {
  const std::string first = *MeshOfStepFile(step_, options_);
  fs::last_write_time(first, fs::file_time_type::clock::now() - std::chrono::hours(24 * 31));
  std::ofstream(step_) << "iso-10303-21; other";
  const std::string other = *MeshOfStepFile(step_, options_);
  EXPECT_FALSE(fs::exists(first));
  EXPECT_TRUE(fs::exists(other));
}

TEST(PartFile, AUnitOfAStepFileIsRefused) {
  EXPECT_THAT(std::string(LoadPartFile("a.stp", "mm").status().message()),
              HasSubstr("a.stp: unit is given, must be left out"));
  EXPECT_TRUE(IsStepFile("b.P21"));
  EXPECT_FALSE(IsStepFile("b.stl"));
}

}  // namespace
}  // namespace sightline
