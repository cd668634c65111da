// SPDX-License-Identifier: Apache-2.0
// Version and git commit of this build. A library of its own: a new commit compiles one file and
// links the programs, nothing else.
#pragma once

#include <string>
#include <string_view>

namespace sightline {

// "PROGRAM VERSION (COMMIT)", the text of `PROGRAM --version`. COMMIT is the abbreviated git
// commit, with "-dirty" where tracked files differed from it, or "unknown" for a build outside git.
std::string VersionText(std::string_view program);

}  // namespace sightline
