// SPDX-License-Identifier: Apache-2.0
// Says why a file is not there.
#pragma once

#include <string>

namespace sightline {

// " (no such file, but \"Part.STL\" is in its folder)" if a name that differs in upper and lower
// case alone is there; empty otherwise. Reads at most some thousand names of the folder.
std::string NameInOtherCase(const std::string& path);

}  // namespace sightline
