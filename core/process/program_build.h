// SPDX-License-Identifier: Apache-2.0
// Identifies the build of the running program, for cached answers: another build may answer
// differently, although it has the same version number.
#pragma once

#include <string>

namespace sightline {

// SHA-256 of the running executable file, even if another file has its path by now. Computed once
// per process. "unknown" if the system does not provide the file.
const std::string& ProgramBuild();

}  // namespace sightline
