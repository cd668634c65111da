// SPDX-License-Identifier: Apache-2.0
// `sightline` and the programs that carry out its commands, as processes.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "planner_client/command_line/command_table.h"
#include "tests/integration/run_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

std::string InBin(std::string_view program) { return BinFolder() + "/" + std::string(program); }

// A folder PREFIX with copies of programs below it.
class Prefix {
 public:
  explicit Prefix(const std::string& name)
      : path_(fs::path(testing::TempDir()) / absl::StrCat("sightline_prefix_", name)) {
    fs::remove_all(path_);
  }
  ~Prefix() { fs::remove_all(path_); }
  Prefix(const Prefix&) = delete;
  Prefix& operator=(const Prefix&) = delete;

  // Returns where the copy is.
  std::string Add(const std::string& folder, std::string_view program) {
    fs::create_directories(path_ / folder);
    fs::copy_file(InBin(program), path_ / folder / program);
    return (path_ / folder / program).string();
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

TEST(CommandPrograms, DispatcherAndProgramAnswerAlike) {
  for (const CommandEntry& command : kCommands) {
    const std::string name(command.name);
    for (const char* words : {" --help", " --no-such-option"}) {
      const ProcessResult dispatched =
          RunProcess(absl::StrCat(InBin("sightline"), " ", name, words));
      const ProcessResult direct =
          RunProcess(absl::StrCat(InBin(command.program), " ", name, words));
      EXPECT_EQ(dispatched.exit_code, direct.exit_code) << name << words;
      EXPECT_EQ(dispatched.output, direct.output) << name << words;
    }
    const ProcessResult help = RunProcess(absl::StrCat(InBin("sightline"), " ", name, " --help"));
    EXPECT_EQ(help.exit_code, 0) << help.output;
    EXPECT_NE(help.output.find("sightline " + name), std::string::npos) << help.output;
  }
}

TEST(CommandPrograms, HelpListsEveryCommand) {
  const ProcessResult help = RunProcess(InBin("sightline") + " --help");
  EXPECT_EQ(help.exit_code, 0);
  for (const CommandEntry& command : kCommands) {
    EXPECT_NE(help.output.find("\n  " + std::string(command.name) + " "), std::string::npos)
        << command.name;
  }
}

TEST(CommandPrograms, OptionsBeforeTheCommandReachIt) {
  const ProcessResult result =
      RunProcess(InBin("sightline") + " --progress json part /no/such/part.stl");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_EQ(result.output.rfind("{\"error\":", 0), 0u) << result.output;
  EXPECT_NE(result.output.find("/no/such/part.stl"), std::string::npos) << result.output;
}

TEST(CommandPrograms, WrongWordsBeforeTheCommandAreExplained) {
  const ProcessResult unknown = RunProcess(InBin("sightline") + " plam x");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_NE(unknown.output.find("did you mean plan?"), std::string::npos) << unknown.output;
  const ProcessResult option = RunProcess(InBin("sightline") + " --progess json plan x");
  EXPECT_EQ(option.exit_code, 2);
  EXPECT_NE(option.output.find("did you mean --progress?"), std::string::npos) << option.output;
  EXPECT_EQ(RunProcess(InBin("sightline") + " --progress plan").exit_code, 2);
  EXPECT_EQ(RunProcess(InBin("sightline")).exit_code, 2);
}

TEST(CommandPrograms, InstalledInLibexecIsFound) {
  Prefix prefix("libexec");
  const std::string sightline = prefix.Add("bin", "sightline");
  prefix.Add("libexec/sightline", kRenderProgram);
  const ProcessResult help = RunProcess(sightline + " effects --help");
  EXPECT_EQ(help.exit_code, 0) << help.output;
  EXPECT_EQ(help.output, RunProcess(InBin("sightline") + " effects --help").output);
}

// Others may write into folders of PATH or into the working folder: programs there are not run.
TEST(CommandPrograms, MissingProgramIsNotLookedForInPathAndIsNamed) {
  Prefix prefix("missing");
  const std::string sightline = prefix.Add("bin", "sightline");
  prefix.Add("elsewhere", kRenderProgram);
  const std::string elsewhere = (prefix.path() / "elsewhere").string();
  const ProcessResult result = RunProcess(
      absl::StrCat("cd ", elsewhere, " && PATH=", elsewhere, ":$PATH ", sightline, " effects"));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.output.find("install the package sightline-render"), std::string::npos)
      << result.output;
  EXPECT_NE(result.output.find("deploy/add-program render"), std::string::npos) << result.output;
  const ProcessResult json = RunProcess(sightline + " --progress json serve --data x");
  EXPECT_EQ(json.exit_code, 1);
  EXPECT_EQ(json.output.rfind("{\"error\":{\"code\":\"NOT_FOUND\"", 0), 0u) << json.output;
}

TEST(CommandPrograms, VersionNamesTheProgramThatIsAsked) {
  for (const char* program :
       {"sightline", "sightline-plan", "sightline-render", "sightline-serve"}) {
    const ProcessResult version = RunProcess(InBin(program) + " --version");
    EXPECT_EQ(version.exit_code, 0);
    EXPECT_EQ(version.output.rfind(std::string(program) + " ", 0), 0u) << version.output;
  }
}

}  // namespace
}  // namespace sightline
