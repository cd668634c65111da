// SPDX-License-Identifier: Apache-2.0
#include "report/optics/detection_section.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "report/optics/optics_text.h"
#include "report/page/html.h"
#include "report/page/number_text.h"

namespace sightline {
ReportBlocks DetectionBlocks(const v1::OpticsChoice& choice) {
  if (!choice.has_detection()) return {};
  const v1::LearnedDetection& learned = choice.detection();
  const v1::LineDetection::Table& table = learned.table();
  const int angles = table.incidence_angles_deg_size();
  if (table.standard_deviations_px_size() != table.distances_m_size() * angles ||
      learned.relative_standard_errors_size() != table.standard_deviations_px_size()) {
    return {};
  }
  std::vector<v1::ReportColumn> columns = {NumberColumn("distance")};
  for (const double angle : table.incidence_angles_deg()) {
    columns.push_back(NumberColumn(QuantityText("incidence_deg", angle)));
    columns.back().set_group("u at an angle of incidence of");
  }
  std::vector<ReportCells> rows;
  for (int d = 0; d < table.distances_m_size(); ++d) {
    ReportCells row = {QuantityCell("distance_m", table.distances_m(d))};
    for (int a = 0; a < angles; ++a) {
      const int entry = d * angles + a;
      const double u_px = table.standard_deviations_px(entry);
      row.push_back(NumberCell(
          u_px, QuantityWithError("u_px", u_px, u_px * learned.relative_standard_errors(entry)),
          "px"));
    }
    rows.push_back(std::move(row));
  }
  return {TableBlock("Detection over distance and angle of incidence", columns, rows),
          RemarkBlock(absl::StrCat(
              "u over distance from the camera and angle of incidence, with missed columns in it, "
              "u² = σ²/a; learned from ",
              GroupedInteger(learned.frames()), " frames with ",
              GroupedInteger(static_cast<int64_t>(learned.line_points())), " points of the line, ",
              GroupedInteger(static_cast<int64_t>(learned.found_points())),
              " of them found. Mean deviation ", QuantityText("bias_px", learned.bias_px()),
              ", left out. Blocks of columns vary ", Number(learned.deviation_dispersion(), 2),
              " times as much as independent columns would; ± is one standard error."))};
}

ReportBlocks RoundBlocks(const v1::OpticsPlan& optics) {
  if (optics.rounds().empty()) return {};
  std::vector<ReportCells> rows;
  for (const v1::JointRound& round : optics.rounds()) {
    v1::OpticsPoint point;
    point.set_f_number(round.setting().f_number());
    *point.mutable_setting() = round.setting();
    const auto learned = [&](const v1::ReportCell& cell) {
      return round.has_detection() ? cell : TextCell(kNoValue);
    };
    rows.push_back({CountCell(static_cast<int64_t>(rows.size()) + 1), CountCell(round.scans()),
                    ShareOfLineCell(round.settled_for()), TextCell(SettingWords(point)),
                    learned(ShareOfLineCell(round.change_of_u())),
                    learned(NumberCell(round.change_in_standard_errors(),
                                       Number(round.change_in_standard_errors(), 2))),
                    learned(ShareOfLineCell(round.settled_with()))});
  }
  return {TableBlock("Rounds of geometry and optics",
                     {NumberColumn("round"), NumberColumn("scans"),
                      NumberColumn("admissible, as planned for"), WordsColumn("best setting"),
                      NumberColumn("change of u"), NumberColumn("in standard errors"),
                      NumberColumn("admissible with it")},
                     rows),
          RemarkBlock(
              optics.rounds_converged()
                  ? "The detection learned in the last round is that which its scans were planned "
                    "for."
                  : "The rounds ended before the detection learned was that which the scans were "
                    "planned for.")};
}

}  // namespace sightline
