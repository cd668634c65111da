// SPDX-License-Identifier: Apache-2.0
#include "planning_service/web/web_page.h"

#include "core/embedded_file/embedded_file.h"

SIGHTLINE_EMBED(sightline_web_index, SIGHTLINE_WEB_PAGE "/index.html")
SIGHTLINE_EMBED(sightline_web_style, SIGHTLINE_WEB_PAGE "/assets/page.css")
SIGHTLINE_EMBED(sightline_web_script, SIGHTLINE_WEB_PAGE "/assets/page.js")
SIGHTLINE_EMBED(sightline_web_part_reader, SIGHTLINE_WEB_PAGE "/assets/part_reader.js")
SIGHTLINE_EMBED(sightline_web_icon, SIGHTLINE_WEB_PAGE "/assets/icon.svg")
SIGHTLINE_EMBED(sightline_web_results_worker, SIGHTLINE_WEB_PAGE "/results_worker.js")

namespace sightline {

std::vector<WebPageFile> WebPage() {
  constexpr char kScript[] = "text/javascript; charset=utf-8";
  return {
      {"/", "text/html; charset=utf-8", SIGHTLINE_EMBEDDED(sightline_web_index)},
      {"/assets/page.css", "text/css; charset=utf-8", SIGHTLINE_EMBEDDED(sightline_web_style)},
      {"/assets/page.js", kScript, SIGHTLINE_EMBEDDED(sightline_web_script)},
      {"/assets/part_reader.js", kScript, SIGHTLINE_EMBEDDED(sightline_web_part_reader)},
      {"/assets/icon.svg", "image/svg+xml", SIGHTLINE_EMBEDDED(sightline_web_icon)},
      // A service worker controls the folder from which it is loaded.
      {"/results_worker.js", kScript, SIGHTLINE_EMBEDDED(sightline_web_results_worker)},
  };
}

}  // namespace sightline
