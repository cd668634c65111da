// SPDX-License-Identifier: Apache-2.0
// Runs the program that reads STEP files. It is separate to keep OpenCASCADE, which depends on X11
// libraries, out of this one.
//
// A CAD system may save a file while it is read. Its bytes are
// therefore read into memory once; both the digest and the program use
// them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sightline {

inline constexpr char kStepProgram[] = "sightline_step_import";

// True for the suffixes .stp, .step and .p21 in any case.
bool IsStepFile(const std::string& file);

struct StepProgramOptions {
  // Empty: FindProgram(kStepProgram) of core/process/program_path.h, else in a folder of PATH.
  std::string program;
  absl::Duration time_limit = absl::Minutes(10);
};

// Returns the program's path. NOT_FOUND states where it was searched and how to install it; `file`:
// for the message.
absl::StatusOr<std::string> FindStepProgram(const std::string& file,
                                            const StepProgramOptions& options);

// The bytes of a file at one moment, in memory (memfd_create(2)).
class StepFile {
 public:
  // NOT_FOUND: no such file. INVALID_ARGUMENT: no regular file, or larger than 2 GiB.
  // RESOURCE_EXHAUSTED: no memory for it.
  static absl::StatusOr<StepFile> Read(const std::string& path);

  StepFile(StepFile&& other) noexcept
      : path_(std::move(other.path_)),
        sha256_(std::move(other.sha256_)),
        descriptor_(std::exchange(other.descriptor_, -1)) {}
  StepFile& operator=(StepFile&&) = delete;
  ~StepFile();

  const std::string& path() const { return path_; }
  // The digest of the bytes, as 64 hexadecimal digits.
  const std::string& sha256() const { return sha256_; }
  int descriptor() const { return descriptor_; }

 private:
  StepFile(std::string path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}

  std::string path_, sha256_;
  int descriptor_ = -1;
};

// Runs the program on these bytes with further arguments and returns its standard output.
// Only one call at a time for one StepFile. INVALID_ARGUMENT: the file is wrong (the
// message names it). NOT_FOUND: as FindStepProgram. CANCELLED: interrupted.
// DEADLINE_EXCEEDED, INTERNAL: it took too long or failed; the message ends with its
// stderr.
absl::StatusOr<std::string> RunStepImport(const StepFile& file,
                                          const std::vector<std::string>& arguments,
                                          const StepProgramOptions& options);
// The same for a file on disk. Errors also as StepFile::Read.
absl::StatusOr<std::string> RunStepImport(const std::string& file,
                                          const std::vector<std::string>& arguments,
                                          const StepProgramOptions& options);

// True if the program rejected a file that states no length unit because none was given.
bool IsMissingStepUnit(const absl::Status& status);

}  // namespace sightline
