// SPDX-License-Identifier: Apache-2.0
// Lists of allowed words in messages.
#pragma once

#include <string>
#include <vector>

namespace sightline {

// "glb, stl or ply"; a single word by itself; empty for no words.
std::string OneOf(const std::vector<std::string>& words);

}  // namespace sightline
