// SPDX-License-Identifier: Apache-2.0
#include "planner_client/acceptance/acceptance_report.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/acceptance/artefact_fit.h"
#include "report/document/report_parts.h"
#include "report/document/report_series.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

std::string TitleOf(const v1::AcceptanceQuantity& quantity) {
  for (const AcceptanceQuantityInfo& info : AcceptanceQuantities()) {
    if (quantity.quantity() == info.name) return info.title;
  }
  return quantity.quantity();
}

std::string Micrometres(double value_m) { return FixedNumber(1e6 * value_m, 1); }

v1::ReportCell MicrometreCell(double value_m) {
  return NumberCell(1e6 * value_m, Micrometres(value_m));
}

v1::ReportCell VerdictCell(const v1::AcceptanceQuantity& quantity) {
  if (!quantity.has_passed()) return TextCell("no limit stated");
  return quantity.passed() ? TextCell("passes") : StrongCell("fails");
}

ReportBlocks QuantityBlocks(const v1::AcceptanceResult& result) {
  std::vector<ReportCells> rows;
  for (const v1::AcceptanceQuantity& q : result.quantities()) {
    rows.push_back(
        {StrongCell(TitleOf(q), q.standard()), TextCell(q.artefact()),
         MicrometreCell(q.simulated_m()), MicrometreCell(q.predicted_m()),
         NumberCell(q.simulated_m() / q.predicted_m(),
                    FixedNumber(q.simulated_m() / q.predicted_m(), 2)),
         NumberCell(100 * q.within_predicted(), FixedNumber(100 * q.within_predicted(), 1)),
         q.has_permitted_m() ? MicrometreCell(q.permitted_m()) : TextCell(kNoValue), VerdictCell(q),
         TextCell(q.dominating_term())});
  }
  return {
      RemarkBlock(absl::StrCat(
          "Simulated: 95 % of ", result.runs(),
          " tests have an error of at most this magnitude. Each test draws other errors of "
          "calibration and detection. Predicted: the same by the uncertainty model that plans "
          "are made with; about 95 % of the tests are within it if that model is right. A "
          "quantity passes if its simulated error is at most the permitted "
          "one.")),
      TableBlock(
          "Quantities of the acceptance test",
          {WordsColumn("quantity"), WordsColumn("artefact"), NumberColumn("simulated", "\u00b5m"),
           NumberColumn("predicted", "\u00b5m"), NumberColumn("simulated / predicted"),
           NumberColumn("tests within predicted", "%"), NumberColumn("permitted", "\u00b5m"),
           WordsColumn("verdict"), WordsColumn("largest cause")},
          rows)};
}

// Causes as columns, quantities as rows.
ReportBlocks TermBlocks(const v1::AcceptanceResult& result) {
  if (result.quantities().empty()) return {};
  std::vector<v1::ReportColumn> columns = {WordsColumn("quantity"), WordsColumn("artefact")};
  std::vector<std::string> causes;  // of any quantity, in the order in which they come
  for (const v1::AcceptanceQuantity& q : result.quantities()) {
    for (const v1::AcceptanceTerm& term : q.terms()) {
      if (std::find(causes.begin(), causes.end(), term.name()) != causes.end()) continue;
      causes.push_back(term.name());
      columns.push_back(NumberColumn(term.name(), "\u00b5m"));
    }
  }
  columns.push_back(NumberColumn("mean error", "\u00b5m"));
  std::vector<ReportCells> rows;
  for (const v1::AcceptanceQuantity& q : result.quantities()) {
    ReportCells row = {TextCell(TitleOf(q)), TextCell(q.artefact())};
    for (const std::string& cause : causes) {
      const auto term = std::find_if(q.terms().begin(), q.terms().end(),
                                     [&](const auto& t) { return t.name() == cause; });
      if (term == q.terms().end()) {
        row.push_back(TextCell(kNoValue));
        continue;
      }
      const std::string text = FixedNumber(1e6 * term->contribution_m(), 2);
      row.push_back(cause == q.dominating_term() ? StrongCell(text)
                                                 : NumberCell(1e6 * term->contribution_m(), text));
    }
    row.push_back(MicrometreCell(q.mean_m()));
    rows.push_back(std::move(row));
  }
  return {RemarkBlock(
              "Contribution of every cause: the standard uncertainty of a size or distance, the "
              "root mean square over the points of a form error. The mean error is that of the "
              "simulated tests; of a form error it is never zero."),
          TableBlock("Causes of the errors", columns, rows)};
}

ReportBlocks DetectionBlocks(const v1::AcceptanceResult& result) {
  const v1::AcceptanceDetection& detection = result.detection();
  std::vector<v1::ReportFact> facts;
  const auto pixels = [](double px) { return FixedNumber(px, 3) + "\u202fpx"; };
  if (!detection.rendered()) {
    return {TextBlock(absl::StrCat(
        "The inspection describes no sensor, lens and laser for images. Detection errors are drawn "
        "from its line detection, ",
        pixels(detection.predicted_px()),
        ". With them the line would be rendered and detected on the artefacts."))};
  }
  facts.push_back(NumberFact("on the rendered sphere", detection.standard_deviation_px(), "px",
                             pixels(detection.standard_deviation_px()), "standard deviation"));
  facts.push_back(NumberFact("mean there", detection.mean_px(), "px", pixels(detection.mean_px())));
  facts.push_back(NumberFact("that the prediction uses", detection.predicted_px(), "px",
                             pixels(detection.predicted_px())));
  facts.push_back(NumberFact("line found", 100 * detection.found_fraction(), "%",
                             FixedNumber(100 * detection.found_fraction(), 1) + "\u202f%"));
  facts.push_back(NumberFact("exposure time", detection.exposure_time_s(), "s",
                             SettingText("exposure_time_s", detection.exposure_time_s())));
  facts.push_back(NumberFact("images", detection.images(), "", absl::StrCat(detection.images())));
  ReportBlocks blocks = {
      RemarkBlock("The line is rendered and detected on the artefacts' surface. Frames between "
                  "rendered ones take the deviations of the nearest, ball bars those of the "
                  "sphere."),
      FactsBlock(facts)};
  v1::ReportChart chart;
  chart.set_title("Detected minus true position of the line");
  *chart.mutable_x() = AxisOf("incidence", "\u00b0");
  *chart.mutable_y() = AxisOf("deviation", "px");
  v1::ReportSeries deviation =
      EmptySeries("standard deviation", v1::REPORT_COLOUR_OBSERVED, v1::ReportSeries::LINE);
  v1::ReportSeries mean = EmptySeries("mean", v1::REPORT_COLOUR_MODEL, v1::ReportSeries::LINE);
  for (const v1::AcceptanceDetection::Bin& bin : detection.by_incidence()) {
    AddPoint(bin.incidence_deg(), bin.standard_deviation_px(), &deviation);
    AddPoint(bin.incidence_deg(), bin.mean_px(), &mean);
  }
  *chart.add_series() = std::move(deviation);
  *chart.add_series() = std::move(mean);
  AddLineAtY(0, &chart);
  if (detection.by_incidence_size() > 1) blocks.push_back(ChartBlock(std::move(chart)));
  return blocks;
}

ReportBlocks PlaceBlocks(const v1::AcceptanceResult& result) {
  const v1::Measurement& place = result.place();
  const auto degrees = [](double angle_deg) { return FixedNumber(angle_deg, 1) + "\u00b0"; };
  return {FactsBlock({NumberFact("camera distance", place.camera_distance_m(), "m",
                                 FixedNumber(1e3 * place.camera_distance_m(), 1) + "\u202fmm"),
                      NumberFact("triangulation angle", place.triangulation_angle_deg(), "\u00b0",
                                 degrees(place.triangulation_angle_deg())),
                      NumberFact("camera azimuth", place.camera_azimuth_deg(), "\u00b0",
                                 degrees(place.camera_azimuth_deg())),
                      NumberFact("camera polar angle", place.camera_polar_deg(), "\u00b0",
                                 degrees(place.camera_polar_deg())),
                      NumberFact("field along the line", result.field_width_m(), "m",
                                 FixedNumber(1e3 * result.field_width_m(), 0) + "\u202fmm")}),
          TextBlock(absl::StrCat("Seed ", result.seed(), ", ", result.runs(),
                                 " tests of every artefact."))};
}

void AddFinding(const v1::AcceptanceResult& result, v1::Report* report) {
  int limited = 0, passed = 0;
  for (const v1::AcceptanceQuantity& q : result.quantities()) {
    if (!q.has_passed()) continue;
    ++limited;
    if (q.passed()) ++passed;
  }
  if (limited == 0) {
    *report->add_finding() = PlainRun(
        "The inspection states no permitted errors (acceptance.limits), so that nothing is "
        "judged.");
    return;
  }
  *report->add_finding() = PlainRun("The rig would ");
  *report->add_finding() = StrongRun(result.passed() ? "pass" : "fail");
  *report->add_finding() = PlainRun(
      absl::StrCat(": ", passed, " of ", limited, " quantities with a limit are within it."));
}

}  // namespace

v1::Report AcceptanceReport(const v1::AcceptanceResult& result) {
  v1::Report report;
  const std::string name = result.inspection_name().empty() ? "Rig" : result.inspection_name();
  report.set_title("Acceptance test: " + name);
  report.set_kind("acceptance");
  report.set_subject("Sightline \u00b7 acceptance test by simulation");
  report.set_heading(name);
  AddFinding(result, &report);
  double largest = 0;
  for (const v1::AcceptanceQuantity& q : result.quantities()) {
    largest = std::max(largest, std::abs(std::log(q.simulated_m() / q.predicted_m())));
    if (q.quantity() == "probing_size_error" || q.quantity() == "probing_form_error_95") {
      *report.add_figures() =
          NumberFact(q.quantity() == "probing_size_error" ? "probing size" : "probing form",
                     q.simulated_m(), "m", Micrometres(q.simulated_m()) + "\u202f\u00b5m",
                     absl::StrCat("predicted ", Micrometres(q.predicted_m())));
    }
  }
  *report.add_figures() = NumberFact("largest ratio of simulated and predicted", std::exp(largest),
                                     "", FixedNumber(std::exp(largest), 2));
  *report.mutable_warnings() = result.warnings();
  AddSection(&report, "quantities", "Errors of the artefacts", QuantityBlocks(result));
  AddSection(&report, "causes", "What the errors come from", TermBlocks(result));
  AddSection(&report, "detection", "Detection of the line", DetectionBlocks(result));
  AddSection(&report, "place", "Place of the sensors", PlaceBlocks(result));
  return report;
}

}  // namespace sightline
