// SPDX-License-Identifier: Apache-2.0
// An inspection whose files are there, for commands that will need them.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"

namespace sightline {

// As ReadInspection, one error a line: all that is wrong with the file up to the number that
// ErrorList takes, and every file of part, obstacles and tolerances that is not there (NOT_FOUND if
// that is the first).
absl::StatusOr<Inspection> ReadInspectionWithFiles(const std::string& path);

}  // namespace sightline
