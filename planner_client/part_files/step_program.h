// SPDX-License-Identifier: Apache-2.0
// The program that reads STEP files: OpenCASCADE, which brings X11 libraries, is not to be part of
// this one.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sightline {

inline constexpr char kStepProgram[] = "sightline_step_import";

// By the suffix of its name: .stp, .step or .p21, in any case.
bool IsStepFile(const std::string& file);

struct StepProgramOptions {
  // Empty: FindProgram(kStepProgram) of core/process/program_path.h, else in a folder of PATH.
  std::string program;
  absl::Duration time_limit = absl::Minutes(10);
};

// Where the program is. NOT_FOUND says where it was looked for and how to get it; `file`: of the
// message.
absl::StatusOr<std::string> FindStepProgram(const std::string& file,
                                            const StepProgramOptions& options);

// Runs it on a STEP file with these further arguments; what it wrote to standard output.
// INVALID_ARGUMENT: the file is wrong (the message names it). NOT_FOUND: as above. CANCELLED: it
// was interrupted. DEADLINE_EXCEEDED, INTERNAL: it took too long or failed; the message ends with
// what it wrote to stderr.
absl::StatusOr<std::string> RunStepImport(const std::string& file,
                                          const std::vector<std::string>& arguments,
                                          const StepProgramOptions& options);

}  // namespace sightline
