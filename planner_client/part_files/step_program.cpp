// SPDX-License-Identifier: Apache-2.0
#include "planner_client/part_files/step_program.h"

#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/digest/sha256.h"
#include "core/file/read_file.h"
#include "core/part/load_part.h"
#include "core/process/program_path.h"
#include "core/process/run_program.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// The tolerances of half a million triangles take about 40 MB.
constexpr size_t kMaxOutputBytes = size_t{1} << 29;

// As much as the program reads.
constexpr uint64_t kMaxStepBytes = uint64_t{1} << 31;
// The beginning of the refusal in tools/step_import/model/length_unit.cpp.
constexpr char kMissingUnit[] = ": part.unit is missing: ";

absl::Status AppendToDescriptor(int descriptor, const char* bytes, size_t count) {
  while (count > 0) {
    const ssize_t written = write(descriptor, bytes, count);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      return absl::ResourceExhaustedError(
          absl::StrCat("cannot be held in memory: ", std::strerror(errno)));
    }
    bytes += written;
    count -= static_cast<size_t>(written);
  }
  return absl::OkStatus();
}

bool IsExecutable(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
}

}  // namespace

bool IsStepFile(const std::string& file) { return IsStepFileName(file); }

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

absl::StatusOr<StepFile> StepFile::Read(const std::string& path) {
  SIGHTLINE_ASSIGN_OR_RETURN(const File file, OpenRegularFile(path));
  StepFile read(path, memfd_create("sightline-step", MFD_CLOEXEC));
  if (read.descriptor_ < 0) {
    return absl::ResourceExhaustedError(
        absl::StrCat(path, ": cannot be held in memory: ", std::strerror(errno)));
  }
  Sha256 digest;
  uint64_t total = 0;
  std::vector<char> buffer(size_t{1} << 20);
  while (const size_t got = std::fread(buffer.data(), 1, buffer.size(), file.get())) {
    total += got;
    if (total > kMaxStepBytes) {
      return absl::InvalidArgumentError(absl::StrCat(path, ": larger than 2 GiB"));
    }
    digest.Update({buffer.data(), got});
    if (absl::Status s = AppendToDescriptor(read.descriptor_, buffer.data(), got); !s.ok()) {
      return absl::Status(s.code(), absl::StrCat(path, ": ", s.message()));
    }
  }
  if (std::ferror(file.get()) != 0) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": cannot be read"));
  }
  read.sha256_ = digest.Hex();
  return read;
}

StepFile::~StepFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

absl::StatusOr<std::string> RunStepImport(const std::string& file,
                                          const std::vector<std::string>& arguments,
                                          const StepProgramOptions& options) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto read, StepFile::Read(file));
  return RunStepImport(read, arguments, options);
}

absl::StatusOr<std::string> RunStepImport(const StepFile& step,
                                          const std::vector<std::string>& arguments,
                                          const StepProgramOptions& options) {
  const std::string& file = step.path();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto program, FindStepProgram(file, options));
  std::vector<std::string> all = {program, "-", absl::StrCat("--name=", file)};
  all.insert(all.end(), arguments.begin(), arguments.end());
  if (lseek(step.descriptor(), 0, SEEK_SET) != 0) {
    return absl::InternalError(absl::StrCat(file, ": ", std::strerror(errno)));
  }
  auto finished =
      RunProgram({.words = std::move(all),
                  .descriptors = {{.number = 0, .ours = step.descriptor()}},
                  .in_our_group = true,
                  .ends_with_us = true},
                 {.time_limit = options.time_limit, .max_output_bytes = kMaxOutputBytes});
  if (!finished.ok()) {
    return absl::Status(finished.status().code(),
                        absl::StrCat(file, ": ", std::string(finished.status().message())));
  }
  absl::StripAsciiWhitespace(&finished->errors);
  const int status = finished->wait_status;
  if (WIFSIGNALED(status)) {
    const int number = WTERMSIG(status);
    // Ctrl-C reaches both programs.
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

bool IsMissingStepUnit(const absl::Status& status) {
  return absl::IsInvalidArgument(status) && absl::StrContains(status.message(), kMissingUnit);
}

}  // namespace sightline
