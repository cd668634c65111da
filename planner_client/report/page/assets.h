// SPDX-License-Identifier: Apache-2.0
// Files of viewer/ inside the program.
#pragma once

#include "absl/strings/string_view.h"

namespace sightline {

absl::string_view ReportTemplate();  // report.html, with {{NAME}} where sections go
absl::string_view ReportStyle();     // report.css
absl::string_view ChartStyle();      // charts.css
absl::string_view ViewerScript();    // viewer.js and three, bundled and minified
absl::string_view DocumentPage();    // document/page.html, with {{NAME}} where data go
absl::string_view DocumentStyle();   // document/document.css
absl::string_view DocumentScript();  // document/main.ts, bundled and minified

}  // namespace sightline
