// SPDX-License-Identifier: Apache-2.0
// Comments in JSON files that people write.
#pragma once

#include <string>

namespace sightline {

// The text with every comment, from `//` outside of a string to the end of its line, turned into
// spaces: the rest keeps its line and column. There are no other comments.
std::string BlankLineComments(std::string json);

}  // namespace sightline
