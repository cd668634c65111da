// SPDX-License-Identifier: Apache-2.0
#include "planner_client/explore/explore_page.h"

#include "core/embedded_file/embedded_file.h"

SIGHTLINE_EMBED(sightline_explore_index, SIGHTLINE_EXPLORE_PAGE "/index.html")
SIGHTLINE_EMBED(sightline_explore_style, SIGHTLINE_EXPLORE_PAGE "/explore.css")
SIGHTLINE_EMBED(sightline_explore_script, SIGHTLINE_EXPLORE_SCRIPT)

namespace sightline {

const std::vector<ExplorePageFile>& ExplorePage() {
  static const std::vector<ExplorePageFile> kFiles = {
      {"/", "text/html; charset=utf-8", SIGHTLINE_EMBEDDED(sightline_explore_index)},
      {"/explore.css", "text/css; charset=utf-8", SIGHTLINE_EMBEDDED(sightline_explore_style)},
      {"/explore.js", "text/javascript; charset=utf-8",
       SIGHTLINE_EMBEDDED(sightline_explore_script)},
  };
  return kFiles;
}

}  // namespace sightline
