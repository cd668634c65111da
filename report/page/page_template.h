// SPDX-License-Identifier: Apache-2.0
// Pages with places to fill.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/string_view.h"

namespace sightline {

// Replaces {{NAME}} marks in one pass: what is put in is not searched again. Marks without a value
// vanish.
std::string FillTemplate(absl::string_view text,
                         const std::vector<std::pair<absl::string_view, std::string>>& values);

}  // namespace sightline
