// SPDX-License-Identifier: Apache-2.0
// STEP files through an importer that a script stands for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/part_files/part_file.h"
#include "planner_client/part_files/private_folder.h"
#include "planner_client/part_files/step_mesh.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// The program is called as IMPORTER - --name=FILE --out MESH ..., with the file on standard input.
class StepMeshTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    options_.program.program = folder_ + "/importer";
    options_.cache_folder = folder_ + "/cache";
    WriteStep("ISO-10303-21;");
    // Counts its calls; what it makes is the file in capitals.
    MakeImporter(CountingScript());
  }
  void TearDown() override {
    fs::remove_all(folder_);
    fs::remove(step_);
  }

  std::string CountingScript() const {
    return "echo x >> " + folder_ + "/calls\nsleep 0.05\ntr a-z A-Z > \"$4\"\n";
  }
  void WriteStep(const std::string& text) const { std::ofstream(step_) << text; }
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
  EXPECT_EQ(fs::path(first->file).extension(), ".glb");
  EXPECT_EQ(Text(first->file), "ISO-10303-21;");
  EXPECT_EQ(first->glb, "ISO-10303-21;");
  EXPECT_EQ(MeshOfStepFile(step_, options_)->file, first->file);
  EXPECT_EQ(Calls(), 1u);
  WriteStep("iso-10303-21; other");
  const auto other = MeshOfStepFile(step_, options_);
  ASSERT_TRUE(other.ok());
  EXPECT_NE(other->file, first->file);
  EXPECT_EQ(other->glb, "ISO-10303-21; OTHER");
  EXPECT_EQ(Calls(), 2u);
}

// Everything that a mesh depends on is in its key. A new option joins by a line.
TEST_F(StepMeshTest, TheKeyHoldsAllThatTheMeshDependsOn) {
  std::set<std::string> files = {MeshOfStepFile(step_, options_)->file};
  const std::vector<std::pair<std::string, std::function<void()>>> changes = {
      {"bytes of the file", [&] { WriteStep("iso-10303-21;"); }},
      {"bytes of the importer, size and time alike",
       [&] {
         const auto time = fs::last_write_time(options_.program.program);
         std::string script = CountingScript();
         script.replace(script.find("0.05"), 4, "0.04");
         MakeImporter(script);
         fs::last_write_time(options_.program.program, time);
       }},
      {"unit", [&] { options_.unit = "mm"; }},
      {"construction geometry", [&] { options_.construction_geometry = true; }},
  };
  for (const auto& [what, change] : changes) {
    change();
    const auto mesh = MeshOfStepFile(step_, options_);
    ASSERT_TRUE(mesh.ok()) << what << ": " << mesh.status();
    EXPECT_TRUE(files.insert(mesh->file).second) << what;
    EXPECT_EQ(Calls(), files.size()) << what;
  }
}

// A CAD system saves while the file is read: what is meshed is what was digested.
TEST_F(StepMeshTest, AFileThatIsSavedMeanwhileKeepsItsKey) {
  MakeImporter("printf 'saved meanwhile' > " + step_ + "\ntr a-z A-Z > \"$4\"\n");
  for (int attempt = 0; attempt < 8; ++attempt) {
    const std::string text = absl::StrCat("attempt ", attempt);
    WriteStep(text);
    EXPECT_EQ(MeshOfStepFile(step_, options_)->glb, absl::StrCat("ATTEMPT ", attempt));
    EXPECT_EQ(Text(step_), "saved meanwhile");
    WriteStep(text);
    EXPECT_EQ(MeshOfStepFile(step_, options_)->glb, absl::StrCat("ATTEMPT ", attempt));
  }
}

TEST_F(StepMeshTest, IsMadeOnceForMany) {
  std::vector<std::jthread> threads;
  std::vector<std::string> meshes(8);
  for (std::string& mesh : meshes) {
    threads.emplace_back([&] { mesh = MeshOfStepFile(step_, options_)->file; });
  }
  threads.clear();
  for (const std::string& mesh : meshes) EXPECT_EQ(mesh, meshes.front());
  EXPECT_EQ(Calls(), 1u);
}

TEST_F(StepMeshTest, DamagedEntriesAreMadeAgainAndNamed) {
  MakeImporter(CountingScript() + "echo 'remark: left out: \"Join.1\"'\n");
  const auto first = MeshOfStepFile(step_, options_);
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_THAT(first->remarks, ElementsAre("left out: \"Join.1\""));
  const std::string record = fs::path(first->file).replace_extension(".record").string();
  const auto changed = [](std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
  };
  const std::string glb_text = Text(first->file), record_text = Text(record);
  const std::vector<std::pair<std::string, std::string>> damages = {
      {first->file, ""},
      {first->file, glb_text + "x"},
      {first->file, changed(glb_text, "ISO", "OSI")},
      {record, ""},
      {record, record_text + "remark: another\n"},
      {record, changed(record_text, "Join.1", "Join.2")},
  };
  size_t calls = 1;
  for (const auto& [file, text] : damages) {
    std::ofstream(file, std::ios::trunc) << text;
    const auto again = MeshOfStepFile(step_, options_);
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_EQ(again->glb, "ISO-10303-21;");
    EXPECT_THAT(again->remarks, ElementsAre("left out: \"Join.1\"",
                                            AllOf(HasSubstr(first->file), HasSubstr("damaged"))));
    EXPECT_EQ(Calls(), ++calls);
    EXPECT_THAT(MeshOfStepFile(step_, options_)->remarks, ElementsAre("left out: \"Join.1\""));
    EXPECT_EQ(Calls(), calls);
  }
}

TEST_F(StepMeshTest, OnlyThisUserReadsTheCache) {
  const mode_t old_mask = umask(022);
  const auto restore = absl::MakeCleanup([&] { umask(old_mask); });
  // As earlier versions have made it.
  ASSERT_EQ(mkdir(options_.cache_folder.c_str(), 0755), 0);
  ASSERT_TRUE(MeshOfStepFile(step_, options_).ok());
  const auto mode = [](const fs::path& path) {
    return static_cast<unsigned>(fs::status(path).permissions());
  };
  EXPECT_EQ(mode(options_.cache_folder), 0700u);
  size_t files = 0;
  for (const auto& entry : fs::directory_iterator(options_.cache_folder)) {
    EXPECT_EQ(mode(entry.path()), 0600u) << entry.path();
    ++files;
  }
  EXPECT_EQ(files, 3u);  // mesh, record, lock
}

TEST_F(StepMeshTest, AServiceSaysWhereItsJobsKeepMeshes) {
  options_.cache_folder.clear();
  const std::string folder = folder_ + "/data/step_cache";
  setenv(kStepCacheVariable, folder.c_str(), 1);
  const auto mesh = MeshOfStepFile(step_, options_);
  setenv(kStepCacheVariable, "/proc/none", 1);
  const auto nowhere = MeshOfStepFile(step_, options_);
  unsetenv(kStepCacheVariable);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(fs::path(mesh->file).parent_path(), folder);
  EXPECT_THAT(std::string(nowhere.status().message()), HasSubstr("/proc/none"));
}

TEST(PrivateFolder, ATemporaryFolderThatIsGoneIsAnError) {
  const std::vector<std::string> names = {"HOME", "XDG_CACHE_HOME", "TMPDIR"};
  std::vector<std::pair<std::string, std::string>> old;
  for (const std::string& name : names) {
    if (const char* value = getenv(name.c_str())) old.emplace_back(name, value);
    setenv(name.c_str(), "/proc/gone", 1);
  }
  const auto folder = UserCacheFolder("step");
  for (const std::string& name : names) unsetenv(name.c_str());
  for (const auto& [name, value] : old) setenv(name.c_str(), value.c_str(), 1);
  EXPECT_EQ(folder.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(folder.status().message()), HasSubstr("/proc/gone"));
}

TEST_F(StepMeshTest, FailuresLeaveNothingBehind) {
  MakeImporter(
      "echo half > \"$4\"; echo 'sightline_step_import: a.step: is no STEP file' >&2\nexit 2\n");
  const absl::Status wrong = MeshOfStepFile(step_, options_).status();
  EXPECT_EQ(wrong.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(wrong.message(), "a.step: is no STEP file");
  EXPECT_FALSE(IsMissingStepUnit(wrong));
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
  const std::string first = MeshOfStepFile(step_, options_)->file;
  fs::last_write_time(first, fs::file_time_type::clock::now() - std::chrono::hours(24 * 31));
  WriteStep("iso-10303-21; other");
  const std::string other = MeshOfStepFile(step_, options_)->file;
  EXPECT_FALSE(fs::exists(first));
  EXPECT_TRUE(fs::exists(other));
}

// Remarks of every reader reach the caller that reads the part.
TEST(PartFile, RemarksOfReadersAreSaid) {
  std::string folder = "/tmp/sightline-remarks-XXXXXX";
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const std::array<float, 9> corners = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::ofstream(folder + "/p.bin", std::ios::binary)
      .write(reinterpret_cast<const char*>(corners.data()), sizeof(corners));
  const std::string path = folder + "/p.gltf";
  std::ofstream(path) << R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
      "scenes": [{"name": "part", "nodes": [0]}, {"name": "fixture", "nodes": [0]}],
      "buffers": [{"byteLength": 36, "uri": "p.bin"}],
      "bufferViews": [{"buffer": 0, "byteLength": 36}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})";
  std::vector<std::string> remarks;
  PartFileOptions options;
  options.remarks = &remarks;
  const auto mesh = LoadPartFile(path, "", options);
  fs::remove_all(folder);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  ASSERT_EQ(remarks.size(), 1u);
  EXPECT_THAT(remarks[0], AllOf(HasSubstr("p.gltf: of its 2 scenes"), HasSubstr("\"fixture\"")));
}

TEST(PartFile, OnlyStepHasConstructionGeometry) {
  PartFileOptions options;
  options.construction_geometry = true;
  for (const absl::Status& refused : {LoadPartFile("a.stl", "mm", options).status(),
                                      MeshFileOf("a.stl", "mm", options).status()}) {
    EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(refused.message()), HasSubstr("a.stl: construction_geometry"));
  }
  EXPECT_TRUE(NeedsPartUnit("a.stl"));
  EXPECT_FALSE(NeedsPartUnit("a.glb"));
  EXPECT_FALSE(NeedsPartUnit("none.stp"));
  EXPECT_EQ(MeshFileOf("a.stl", "mm")->unit, "mm");
  EXPECT_TRUE(IsStepFile("b.P21"));
  EXPECT_FALSE(IsStepFile("b.stl"));
}

// Names in files are text, never commands to a terminal.
TEST(PartFileNames, ArePrintedWithoutControlCharacters) {
  const std::string folder = testing::TempDir() + absl::StrCat("names_", getpid());
  fs::create_directories(folder);
  const std::string path = folder + "/\x1b[31mpart\u202e.gltf";
  std::ofstream(path) << R"({"asset": {"version": "2.0"},
    "nodes": [{"mesh": 0}], "scenes": [{"name": "a\u202e\u001b[2Jb", "nodes": [0]}, {"nodes": [0]}],
    "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,)"
                      << "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"
                      << R"("}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})";
  testing::internal::CaptureStderr();
  const auto part = LoadPartFile(path, "");
  const std::string said = testing::internal::GetCapturedStderr();
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_THAT(said, AllOf(HasSubstr("\\x1b[31mpart\\u202e.gltf"), HasSubstr("scenes[0]")));
  EXPECT_EQ(said.find('\x1b'), std::string::npos) << said;
  EXPECT_EQ(said.find("\u202e"), std::string::npos) << said;
  fs::remove_all(folder);

  testing::internal::CaptureStdout();
  PrintText("%s: %d faces\n", std::string("a\x1b]0;x\x07\u2066"), 3);
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "a\\x1b]0;x\\x07\\u2066: 3 faces\n");
}

}  // namespace
}  // namespace sightline
