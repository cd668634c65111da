// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/page/assets.h"

#include "core/embedded_file/embedded_file.h"

SIGHTLINE_EMBED(sightline_report_template, SIGHTLINE_REPORT_TEMPLATE)
SIGHTLINE_EMBED(sightline_report_style, SIGHTLINE_REPORT_STYLE)
SIGHTLINE_EMBED(sightline_chart_style, SIGHTLINE_CHART_STYLE)
SIGHTLINE_EMBED(sightline_viewer_script, SIGHTLINE_VIEWER_SCRIPT)
SIGHTLINE_EMBED(sightline_document_page, SIGHTLINE_DOCUMENT_PAGE)
SIGHTLINE_EMBED(sightline_document_style, SIGHTLINE_DOCUMENT_STYLE)
SIGHTLINE_EMBED(sightline_document_script, SIGHTLINE_DOCUMENT_SCRIPT)

namespace sightline {

absl::string_view ReportTemplate() { return SIGHTLINE_EMBEDDED(sightline_report_template); }
absl::string_view ReportStyle() { return SIGHTLINE_EMBEDDED(sightline_report_style); }
absl::string_view ChartStyle() { return SIGHTLINE_EMBEDDED(sightline_chart_style); }
absl::string_view ViewerScript() { return SIGHTLINE_EMBEDDED(sightline_viewer_script); }
absl::string_view DocumentPage() { return SIGHTLINE_EMBEDDED(sightline_document_page); }
absl::string_view DocumentStyle() { return SIGHTLINE_EMBEDDED(sightline_document_style); }
absl::string_view DocumentScript() { return SIGHTLINE_EMBEDDED(sightline_document_script); }

}  // namespace sightline
