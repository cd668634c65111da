#include "planner_client/report/page/assets.h"

// The assembler copies the files' bytes into read-only data; the build gives their paths.
#define SIGHTLINE_EMBED(symbol, path)     \
  asm(".section .rodata\n"                \
      ".global " #symbol "\n" #symbol     \
      ":\n"                               \
      ".incbin \"" path                   \
      "\"\n"                              \
      ".global " #symbol "_end\n" #symbol \
      "_end:\n"                           \
      ".byte 0\n"                         \
      ".previous\n");                     \
  extern "C" const char symbol[];         \
  extern "C" const char symbol##_end[];

SIGHTLINE_EMBED(sightline_report_template, SIGHTLINE_REPORT_TEMPLATE)
SIGHTLINE_EMBED(sightline_report_style, SIGHTLINE_REPORT_STYLE)
SIGHTLINE_EMBED(sightline_chart_style, SIGHTLINE_CHART_STYLE)
SIGHTLINE_EMBED(sightline_viewer_script, SIGHTLINE_VIEWER_SCRIPT)

namespace sightline {
namespace {

absl::string_view Between(const char* begin, const char* end) {
  return absl::string_view(begin, static_cast<size_t>(end - begin));
}

}  // namespace

absl::string_view ReportTemplate() {
  return Between(sightline_report_template, sightline_report_template_end);
}
absl::string_view ReportStyle() {
  return Between(sightline_report_style, sightline_report_style_end);
}
absl::string_view ChartStyle() { return Between(sightline_chart_style, sightline_chart_style_end); }
absl::string_view ViewerScript() {
  return Between(sightline_viewer_script, sightline_viewer_script_end);
}

}  // namespace sightline
