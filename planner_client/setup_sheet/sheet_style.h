// SPDX-License-Identifier: Apache-2.0
// setup_sheet.css inside the program.
#pragma once

#include "absl/strings/string_view.h"

namespace sightline {

absl::string_view SheetStyle();

}  // namespace sightline
