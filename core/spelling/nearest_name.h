// SPDX-License-Identifier: Apache-2.0
// Finds the known name that is nearest to a misspelt one.
#pragma once

#include <string>
#include <vector>

namespace sightline {

// The name of `known` with the fewest letters inserted, left out or replaced (Levenshtein), the
// first of equal ones; words left out at the end (dark_noise of dark_noise_electrons) count as one.
// Empty if there is none. Only the first 100 bytes of `name` are looked at.
std::string NearestName(const std::string& name, const std::vector<std::string>& known);

// The same, but empty if `name` is not similar to any: more than a third of its letters, and more
// than two, would have to change.
std::string LikelyName(const std::string& name, const std::vector<std::string>& known);

}  // namespace sightline
