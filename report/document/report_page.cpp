// SPDX-License-Identifier: Apache-2.0
#include "report/document/report_page.h"

#include <algorithm>
#include <filesystem>

#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "report/page/assets.h"
#include "report/page/html.h"
#include "report/page/page_template.h"

namespace sightline {
namespace {

template <class Blocks>
bool HasScene(const Blocks& blocks) {
  return std::any_of(blocks.begin(), blocks.end(), [](const v1::ReportBlock& block) {
    return block.has_scene() || HasScene(block.group().blocks());
  });
}

bool HasScene(const v1::Report& report) {
  return std::any_of(report.sections().begin(), report.sections().end(),
                     [](const auto& section) { return HasScene(section.blocks()); });
}

}  // namespace

std::string ReportPage(const v1::Report& report, const std::string& data_file) {
  std::string scene, scene_style;
  if (HasScene(report)) {
    scene = FillTemplate(ScenePage(), {{"SCENE_SCRIPT", std::string(SceneScript())}});
    scene_style = std::string(SceneStyle());
  }
  return FillTemplate(DocumentPage(), {{"TITLE", EscapeHtml(report.title())},
                                       {"STYLE", std::string(DocumentStyle())},
                                       {"SCENE_STYLE", scene_style},
                                       {"DATA_FILE", EscapeHtml(data_file)},
                                       {"DATA", JsonForScript(CompactJson(ToJson(report)))},
                                       {"SCENE", scene},
                                       {"SCRIPT", std::string(DocumentScript())}});
}

std::string ReportDataPath(const std::string& page_path) {
  const std::filesystem::path page(page_path);
  const std::string stem = page.stem().string();
  return (page.parent_path() / (stem == "report" ? "report.json" : stem + "_report.json")).string();
}

absl::Status WriteReport(const v1::Report& report, const std::string& page_path) {
  const std::string data_path = ReportDataPath(page_path);
  SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(data_path, ToJson(report)));
  return WriteFileAtomically(
      page_path, ReportPage(report, std::filesystem::path(data_path).filename().string()));
}

}  // namespace sightline
