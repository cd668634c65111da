// SPDX-License-Identifier: Apache-2.0
#include "planner_client/part_files/step_program.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/process/program_path.h"
#include "core/process/run_program.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// The tolerances of half a million triangles take about 40 MB.
constexpr size_t kMaxOutputBytes = size_t{1} << 29;

bool IsExecutable(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
}

}  // namespace

bool IsStepFile(const std::string& file) {
  const std::string suffix = absl::AsciiStrToLower(fs::path(file).extension().string());
  return suffix == ".stp" || suffix == ".step" || suffix == ".p21";
}

absl::StatusOr<std::string> FindStepProgram(const std::string& file,
                                            const StepProgramOptions& options) {
  const fs::path beside =
      options.program.empty() ? FindProgram(kStepProgram) : fs::path(options.program);
  if (IsExecutable(beside)) return beside.string();
  const char* path = std::getenv("PATH");
  if (options.program.empty() && path != nullptr) {
    for (const absl::string_view folder : absl::StrSplit(path, ':', absl::SkipEmpty())) {
      const fs::path there = fs::path(std::string(folder)) / kStepProgram;
      if (there.is_absolute() && IsExecutable(there)) return there.string();
    }
  }
  return absl::NotFoundError(absl::StrCat(
      file, ": STEP is read by the program ", kStepProgram, ", and there is no executable ",
      beside.string(), options.program.empty() ? ", nor one in PATH" : "",
      "; install the package sightline-step-import, or in a source folder run "
      "deploy/add-program step-import"));
}

absl::StatusOr<std::string> RunStepImport(const std::string& file,
                                          const std::vector<std::string>& arguments,
                                          const StepProgramOptions& options) {
  const auto program = FindStepProgram(file, options);
  if (!program.ok()) return program.status();
  // Absolute, so that no name is taken for an option.
  std::vector<std::string> all = {*program, fs::absolute(file).string()};
  all.insert(all.end(), arguments.begin(), arguments.end());
  auto finished =
      RunProgram({.words = std::move(all), .in_our_group = true, .ends_with_us = true},
                 {.time_limit = options.time_limit, .max_output_bytes = kMaxOutputBytes});
  if (!finished.ok()) {
    return absl::Status(finished.status().code(),
                        absl::StrCat(file, ": ", std::string(finished.status().message())));
  }
  absl::StripAsciiWhitespace(&finished->errors);
  const int status = finished->wait_status;
  if (WIFSIGNALED(status)) {
    const int number = WTERMSIG(status);
    // Ctrl-C goes to both programs.
    if (number == SIGINT) return absl::CancelledError(absl::StrCat(file, ": interrupted"));
    return absl::InternalError(absl::StrCat(file, ": ", kStepProgram, " was killed by signal ",
                                            number, ": ", finished->errors));
  }
  if (WEXITSTATUS(status) != 0) {
    const std::string message(
        absl::StripPrefix(finished->errors, absl::StrCat(kStepProgram, ": ")));
    // 2: the input is wrong, and the message names it.
    if (WEXITSTATUS(status) == 2) return absl::InvalidArgumentError(message);
    return absl::InternalError(absl::StrCat(file, ": ", kStepProgram, " ended with exit code ",
                                            WEXITSTATUS(status), ": ", message));
  }
  return std::move(finished->output);
}

}  // namespace sightline
