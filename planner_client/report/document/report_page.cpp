// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/document/report_page.h"

#include <filesystem>

#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "planner_client/report/page/assets.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/page_template.h"

namespace sightline {

std::string ReportPage(const v1::Report& report, const std::string& data_file) {
  return FillTemplate(DocumentPage(), {{"TITLE", EscapeHtml(report.title())},
                                       {"STYLE", std::string(DocumentStyle())},
                                       {"DATA_FILE", EscapeHtml(data_file)},
                                       {"DATA", JsonForScript(ToJson(report))},
                                       {"SCRIPT", std::string(DocumentScript())}});
}

std::string ReportDataPath(const std::string& page_path) {
  const std::filesystem::path page(page_path);
  const std::string stem = page.stem().string();
  return (page.parent_path() / (stem == "report" ? "report.json" : stem + "_report.json")).string();
}

absl::Status WriteReport(const v1::Report& report, const std::string& page_path) {
  const std::string data_path = ReportDataPath(page_path);
  if (absl::Status status = WriteFileAtomically(data_path, ToJson(report)); !status.ok()) {
    return status;
  }
  return WriteFileAtomically(
      page_path, ReportPage(report, std::filesystem::path(data_path).filename().string()));
}

}  // namespace sightline
