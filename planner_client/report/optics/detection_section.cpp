// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/optics/detection_section.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "planner_client/report/optics/optics_text.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"

namespace sightline {
std::string DetectionSection(const v1::OpticsChoice& choice) {
  if (!choice.has_detection()) return "";
  const v1::LearnedDetection& learned = choice.detection();
  const v1::LineDetection::Table& table = learned.table();
  const int angles = table.incidence_angles_deg_size();
  if (table.standard_deviations_px_size() != table.distances_m_size() * angles ||
      learned.relative_standard_errors_size() != table.standard_deviations_px_size()) {
    return "";
  }
  std::vector<std::string> head = {"distance"};
  for (const double angle : table.incidence_angles_deg()) {
    head.push_back(EscapeHtml(QuantityText("incidence_deg", angle)));
  }
  std::vector<std::vector<std::string>> rows;
  for (int d = 0; d < table.distances_m_size(); ++d) {
    std::vector<std::string> row = {EscapeHtml(QuantityText("distance_m", table.distances_m(d)))};
    for (int a = 0; a < angles; ++a) {
      const int entry = d * angles + a;
      const double u_px = table.standard_deviations_px(entry);
      row.push_back(EscapeHtml(
          QuantityWithError("u_px", u_px, u_px * learned.relative_standard_errors(entry))));
    }
    rows.push_back(std::move(row));
  }
  return PageTable(head, rows, {0}) +
         SoftParagraph(absl::StrCat(
             "u over distance from the camera and angle of incidence, with missed columns in it, "
             "u² "
             "= σ²/a; learned from ",
             GroupedInteger(learned.frames()), " frames with ",
             GroupedInteger(static_cast<int64_t>(learned.line_points())), " points of the line, ",
             GroupedInteger(static_cast<int64_t>(learned.found_points())),
             " of them found. Mean deviation ",
             EscapeHtml(QuantityText("bias_px", learned.bias_px())),
             ", left out. Blocks of columns vary ", Number(learned.deviation_dispersion(), 2),
             " times as much as independent columns would; ± is one standard error."));
}

std::string RoundsSection(const v1::OpticsPlan& optics) {
  if (optics.rounds().empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const v1::JointRound& round : optics.rounds()) {
    v1::OpticsPoint point;
    point.set_f_number(round.setting().f_number());
    *point.mutable_setting() = round.setting();
    rows.push_back({absl::StrCat(rows.size() + 1), absl::StrCat(round.scans()),
                    EscapeHtml(ShareText(round.settled_for())), EscapeHtml(SettingWords(point)),
                    round.has_detection() ? EscapeHtml(ShareText(round.change_of_u())) : "–",
                    round.has_detection() ? Number(round.change_in_standard_errors(), 2) : "–",
                    round.has_detection() ? EscapeHtml(ShareText(round.settled_with())) : "–"});
  }
  return PageTable({"round", "scans", "admissible,<br>as planned for", "best setting",
                    "change of u", "in standard<br>errors", "admissible<br>with it"},
                   rows, {0, 3}) +
         SoftParagraph(
             optics.rounds_converged()
                 ? "The detection learned in the last round is that which its scans were planned "
                   "for."
                 : "The rounds ended before the detection learned was that which the scans were "
                   "planned for.");
}

}  // namespace sightline
