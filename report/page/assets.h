// SPDX-License-Identifier: Apache-2.0
// Files of viewer/ inside the program.
#pragma once

#include "absl/strings/string_view.h"

namespace sightline {

absl::string_view ScenePage();       // scene.html, with {{NAME}} marks for the script
absl::string_view SceneStyle();      // scene.css
absl::string_view SceneScript();     // viewer.js and three, bundled and minified
absl::string_view DocumentPage();    // document/page.html, with {{NAME}} marks for data
absl::string_view DocumentStyle();   // document/document.css
absl::string_view DocumentScript();  // document/main.ts, bundled and minified

}  // namespace sightline
