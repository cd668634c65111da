// SPDX-License-Identifier: Apache-2.0
#include "planner_client/setup_sheet/sheet_style.h"

#include "core/embedded_file/embedded_file.h"

SIGHTLINE_EMBED(sightline_sheet_style, SIGHTLINE_SHEET_STYLE)

namespace sightline {

absl::string_view SheetStyle() { return SIGHTLINE_EMBEDDED(sightline_sheet_style); }

}  // namespace sightline
