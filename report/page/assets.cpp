// SPDX-License-Identifier: Apache-2.0
#include "report/page/assets.h"

#include "core/embedded_file/embedded_file.h"

SIGHTLINE_EMBED(sightline_scene_page, SIGHTLINE_SCENE_PAGE)
SIGHTLINE_EMBED(sightline_scene_style, SIGHTLINE_SCENE_STYLE)
SIGHTLINE_EMBED(sightline_scene_script, SIGHTLINE_SCENE_SCRIPT)
SIGHTLINE_EMBED(sightline_document_page, SIGHTLINE_DOCUMENT_PAGE)
SIGHTLINE_EMBED(sightline_document_style, SIGHTLINE_DOCUMENT_STYLE)
SIGHTLINE_EMBED(sightline_document_script, SIGHTLINE_DOCUMENT_SCRIPT)

namespace sightline {

absl::string_view ScenePage() { return SIGHTLINE_EMBEDDED(sightline_scene_page); }
absl::string_view SceneStyle() { return SIGHTLINE_EMBEDDED(sightline_scene_style); }
absl::string_view SceneScript() { return SIGHTLINE_EMBEDDED(sightline_scene_script); }
absl::string_view DocumentPage() { return SIGHTLINE_EMBEDDED(sightline_document_page); }
absl::string_view DocumentStyle() { return SIGHTLINE_EMBEDDED(sightline_document_style); }
absl::string_view DocumentScript() { return SIGHTLINE_EMBEDDED(sightline_document_script); }

}  // namespace sightline
