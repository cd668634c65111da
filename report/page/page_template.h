// SPDX-License-Identifier: Apache-2.0
// Page templates with placeholders.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/string_view.h"

namespace sightline {

// Replaces {{NAME}} marks in one pass, so that marks inside inserted texts stay. Marks without a
// value are removed.
std::string FillTemplate(absl::string_view text,
                         const std::vector<std::pair<absl::string_view, std::string>>& values);

}  // namespace sightline
