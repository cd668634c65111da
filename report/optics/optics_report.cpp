// SPDX-License-Identifier: Apache-2.0
#include "report/optics/optics_report.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "report/document/report_page.h"
#include "report/document/report_parts.h"
#include "report/optics/choice_blocks.h"
#include "report/optics/detection_section.h"
#include "report/optics/optics_charts.h"
#include "report/optics/optics_text.h"
#include "report/page/html.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

OpticsCurve CurveOf(const v1::OpticsPlan& optics) {
  OpticsCurve curve;
  if (optics.has_best() || optics.common().has_best()) {
    curve.best = optics.has_best() ? &optics.best() : &optics.common().best();
  }
  for (const v1::OpticsPoint& point :
       optics.curve().empty() ? optics.common().curve() : optics.curve()) {
    curve.points.push_back(&point);
  }
  std::stable_sort(curve.points.begin(), curve.points.end(),
                   [](const v1::OpticsPoint* a, const v1::OpticsPoint* b) {
                     return a->f_number() < b->f_number();
                   });
  curve.longest_exposure_time_s = optics.common().longest_exposure_time_s();
  return curve;
}

v1::ReportFact QuantityFact(const std::string& title, const std::string& name, double value,
                            const std::string& detail = "") {
  const ShownUnit unit = ShownUnitOf(name, 1);
  return NumberFact(title, unit.per_named * value, unit.name, QuantityText(name, value), detail);
}

void AddOpticsFigures(const v1::OpticsPlan& optics, const v1::OpticsPoint& best,
                      v1::Report* report) {
  const auto add = [&](const v1::ReportFact& fact) { *report->add_figures() = fact; };
  add(QuantityFact("scatter of the line, u\u209a\u2093", "u_px", UPx(best), UPxInterval(best)));
  if (std::isfinite(ExpectedRealUPx(best))) {
    add(QuantityFact("u\u209a\u2093 expected of the real camera", "u_px", ExpectedRealUPx(best),
                     RealUPxInterval(best)));
  }
  if (best.u_height_m() != 0) {
    add(QuantityFact("scatter as height", "u_height_m", best.u_height_m()));
  }
  add(NumberFact("detected part of the line", 100 * best.profile_coverage(), "%",
                 ShareText(best.profile_coverage()), CoverageInterval(best)));
  add(QuantityFact("cost", "cost_px", best.cost(), CostInterval(best)));
  add(NumberFact("false lines per column", best.false_lines_per_column(), "",
                 Number(best.false_lines_per_column(), 2)));
  const double scan_time_s =
      best.scan_time_s() != 0 ? best.scan_time_s() : optics.common().scan_time_s();
  if (scan_time_s > 0) {
    add(QuantityFact(optics.scans_size() > 1 ? "time of all scans" : "time of the scan", "time_s",
                     scan_time_s));
  }
}

ReportBlocks FNumberSection(const OpticsCurve& curve, const v1::OpticsChoice& common) {
  ReportBlocks blocks = FNumberBlocks(curve);
  const std::string& reason = common.longest_because();
  // Without a stated reason the charts' key is sufficient.
  if (blocks.empty() || common.longest_exposure_time_s() == 0 || reason.empty()) return blocks;
  blocks.push_back(RemarkBlock(absl::StrCat("Longest exposure time possible, ",
                                            SettingText("time_s", common.longest_exposure_time_s()),
                                            ": ", reason, reason.back() == '.' ? "" : ".")));
  return blocks;
}

// Effect of a verification's errors on the expectation for the real camera.
ReportBlocks CorrectionBlocks(const v1::UncertaintyCorrection& correction) {
  std::vector<ReportCells> rows;
  const auto error = [](double relative) {
    return NumberCell(100 * relative, QuantityText("e_relative", relative, 2), "%");
  };
  for (const v1::UncertaintyCorrection::FNumberError& of : correction.by_f_number()) {
    rows.push_back({NumberCell(of.f_number(), FNumberText(of.f_number())), error(of.mean_e_u()),
                    of.recordings() > 1 || of.standard_deviation() > 0
                        ? error(of.standard_deviation())
                        : TextCell("not known"),
                    CountCell(of.recordings())});
  }
  if (rows.empty()) return {};
  return {TableBlock("Errors of the simulated scatter",
                     {NumberColumn("f-number"), NumberColumn("mean e\u1d64"),
                      NumberColumn("deviation between recordings"), NumberColumn("recordings")},
                     rows)};
}

ReportBlocks MethodBlocks(const v1::OpticsPlan& optics) {
  std::string text =
      "The cost is f = a u\u209a\u2093 + (1 \u2212 a) u\u209a\u1d63 (thesis, eq. 6.5): a is the "
      "part of the line that is detected, u\u209a\u2093 the standard deviation of its detected "
      "minus its true position, and u\u209a\u1d63 the prior uncertainty, which a column without a "
      "detected line is left with; false lines and time are added where the inspection gives them "
      "a cost. The true position is where the laser sheet meets the part in a geometric image, "
      "not a curve fitted to what was detected. Every setting is judged by several realisations "
      "of speckle and noise in each of the frames. An interval is where the number of a fresh "
      "frame \u2013 other speckle, other noise \u2013 lies in 95 of 100 cases. Two settings are "
      "compared by the standard error of the difference of their costs: as good as the best is "
      "what costs no more than 1.96 of them above it. ";
  const v1::UncertaintyCorrection& correction = optics.correction();
  if (optics.has_correction()) {
    absl::StrAppend(
        &text,
        "The real camera is expected to have u_real = u_sim/(1 \u2212 e\u1d64) (eq. 6.8), e\u1d64 "
        "being the error of the simulated scatter in a verification with recordings",
        correction.source().empty() ? "" : absl::StrCat(" (", correction.source(), ")"), ".");
  } else {
    text +=
        "No verification was given, so u\u209a\u2093 is that of the simulation, without the "
        "correction u_real = u_sim/(1 \u2212 e\u1d64) (eq. 6.8).";
  }
  ReportBlocks blocks = {TextBlock(text)};
  if (optics.has_correction()) {
    for (v1::ReportBlock& block : CorrectionBlocks(correction)) blocks.push_back(std::move(block));
  }
  std::vector<std::string> origin;
  if (!optics.inspection_name().empty()) {
    origin.push_back(absl::StrCat("inspection ", optics.inspection_name()));
  }
  if (!optics.sightline_version().empty()) {
    origin.push_back(absl::StrCat("Sightline ", optics.sightline_version()));
  }
  origin.push_back(absl::StrCat("seed ", optics.seed()));
  origin.push_back(absl::StrCat(GroupedInteger(optics.evaluated_images()), " images looked at"));
  blocks.push_back(
      RemarkBlock(absl::StrCat("To get this again: ", absl::StrJoin(origin, ", "), ".")));
  return blocks;
}

}  // namespace

v1::Report OpticsReport(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices) {
  const OpticsCurve curve = CurveOf(optics);
  const std::string& name = optics.inspection_name();
  v1::Report report;
  report.set_title(absl::StrCat(name.empty() ? "Inspection" : name, " \u2013 optics"));
  report.set_kind("optics");
  report.set_subject(absl::StrCat("Sightline \u00b7 optics", name.empty() ? "" : " \u00b7 ", name));
  if (curve.best != nullptr) report.set_heading(SettingWords(*curve.best));
  if (report.heading().empty()) report.set_heading("No setting was found");
  if (!optics.common().statement().empty()) {
    *report.add_finding() = PlainRun(optics.common().statement());
  }
  if (curve.best != nullptr) AddOpticsFigures(optics, *curve.best, &report);
  *report.mutable_warnings() = optics.warnings();
  AddSection(&report, "f-number", "What every f-number can do",
             FNumberSection(curve, optics.common()));
  AddSection(&report, "exposure", "Cost against exposure time", ExposureBlocks(curve));
  AddSection(&report, "curve", "Every f-number in numbers", CurveTableBlocks(curve));
  AddSection(&report, "alternatives", "What a freedom is worth",
             AlternativeBlocks(optics, curve.best));
  AddSection(&report, "scans", "A setting for every scan", ScanSettingBlocks(optics, curve.best));
  AddSection(&report, "rounds", "Geometry and optics in turn", RoundBlocks(optics));
  AddSection(&report, "detection", "What planning of the geometry needs",
             DetectionBlocks(optics.common()));
  AddSection(&report, "frames", "Frames it was judged by", FrameBlocksOf(optics));
  AddSection(&report, "devices", "Cameras, lenses and lasers", DeviceBlocks(devices));
  AddSection(&report, "method", "How this was computed", MethodBlocks(optics));
  return report;
}

absl::Status WriteOpticsReport(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices,
                               const std::string& path) {
  return WriteReport(OpticsReport(optics, devices), path);
}

}  // namespace sightline
