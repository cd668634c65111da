// SPDX-License-Identifier: Apache-2.0
// A name for the build of the running program, for answers that are kept: another build may answer
// otherwise, although it has the same version number.
#pragma once

#include <string>

namespace sightline {

// SHA-256 of the running executable file, also where another one has its path by now. It is
// computed once per process. "unknown" where the system does not give the file.
const std::string& ProgramBuild();

}  // namespace sightline
