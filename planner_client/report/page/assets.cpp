// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/page/assets.h"

#include "core/embedded_file/embedded_file.h"

SIGHTLINE_EMBED(sightline_report_template, SIGHTLINE_REPORT_TEMPLATE)
SIGHTLINE_EMBED(sightline_report_style, SIGHTLINE_REPORT_STYLE)
SIGHTLINE_EMBED(sightline_chart_style, SIGHTLINE_CHART_STYLE)
SIGHTLINE_EMBED(sightline_viewer_script, SIGHTLINE_VIEWER_SCRIPT)

namespace sightline {

absl::string_view ReportTemplate() { return SIGHTLINE_EMBEDDED(sightline_report_template); }
absl::string_view ReportStyle() { return SIGHTLINE_EMBEDDED(sightline_report_style); }
absl::string_view ChartStyle() { return SIGHTLINE_EMBEDDED(sightline_chart_style); }
absl::string_view ViewerScript() { return SIGHTLINE_EMBEDDED(sightline_viewer_script); }

}  // namespace sightline
