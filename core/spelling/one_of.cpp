// SPDX-License-Identifier: Apache-2.0
#include "core/spelling/one_of.h"

#include <cstddef>

#include "absl/strings/str_cat.h"

namespace sightline {

std::string OneOf(const std::vector<std::string>& words) {
  std::string text;
  for (size_t i = 0; i < words.size(); ++i) {
    absl::StrAppend(&text, i == 0 ? "" : i + 1 == words.size() ? " or " : ", ", words[i]);
  }
  return text;
}

}  // namespace sightline
