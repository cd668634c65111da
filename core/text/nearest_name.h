// Which known name may have been meant.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace sightline {

// The known name with the least edit distance (Levenshtein 1966) from the first 100 characters of
// `name`, the first of equals; empty if `known` is.
std::string NearestName(std::string_view name, std::span<const std::string_view> known);

}  // namespace sightline
