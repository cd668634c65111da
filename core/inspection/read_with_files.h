// SPDX-License-Identifier: Apache-2.0
// Reads an inspection and checks that its files exist, for commands that need them.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"

namespace sightline {

// As ReadInspection, with one error per line: all errors of the file up to ErrorList::kMostErrors,
// and every missing file of part, obstacles and tolerances (NOT_FOUND if such an error is the
// first).
absl::StatusOr<Inspection> ReadInspectionWithFiles(const std::string& path);

}  // namespace sightline
