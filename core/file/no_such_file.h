// SPDX-License-Identifier: Apache-2.0
// Explains why a file does not exist.
#pragma once

#include <string>

namespace sightline {

// " (no such file, but \"Part.STL\" is in its folder)" if the folder has a name that differs only
// in upper and lower case; else empty. Reads at most some thousand names of the folder.
std::string NameInOtherCase(const std::string& path);

}  // namespace sightline
