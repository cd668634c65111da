// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/diagnosis/missing_term_sections.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "planner_client/report/charts/xy_chart.h"
#include "planner_client/report/diagnosis/diagnosis_text.h"
#include "planner_client/report/diagnosis/diagnosis_view.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"

namespace sightline {

std::string StagesHtml(const DiagnosisView& view) {
  if (view.diagnosis.stages().empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const v1::StageEvidence& stage : view.diagnosis.stages()) {
    rows.push_back({absl::StrCat("<span class=\"effect\">", EscapeHtml(QuantityName(stage.stage())),
                                 "</span>"),
                    ProbabilityBar(stage.probability()), GainText(stage.log_evidence_gain())});
  }
  return SoftParagraph("How well a free term at one stage absorbs what is left.") +
         PageTable({"stage", "probability", "gain in log evidence [nats]"}, rows, {0, 1});
}

std::string LawsHtml(const DiagnosisView& view) {
  if (view.diagnosis.laws().empty()) return "";
  // One entry that says that there is no dependence.
  if (view.diagnosis.laws_size() == 1 && view.diagnosis.laws(0).quantity() == "none") {
    return absl::StrCat("<p>", LawHtml(view.diagnosis.laws(0).law()), "</p>\n");
  }
  std::vector<std::vector<std::string>> rows;
  for (const v1::SetupLaw& law : view.diagnosis.laws()) {
    rows.push_back({absl::StrCat("<span class=\"effect\">",
                                 EscapeHtml(QuantityName(law.quantity())), "</span>"),
                    LawHtml(law.law()),
                    law.exponent() == 0 && law.exponent_standard_error() == 0
                        ? "\u2013"
                        : EscapeHtml(QuantityWithError("exponent", law.exponent(),
                                                       law.exponent_standard_error())),
                    ProbabilityBar(law.explained())});
  }
  return PageTable({"quantity", "law", "exponent", "part of the residual it explains"}, rows,
                   {0, 1, 3});
}

std::string FreeFormHtml(const DiagnosisView& view) {
  const v1::FreeFormTerm& term = view.diagnosis.free_form();
  if (!view.diagnosis.has_free_form()) return "";
  std::string html = absl::StrCat(
      "<p>A term",
      term.term().empty() ? ""
                          : absl::StrCat(" of the kind <strong>",
                                         EscapeHtml(QuantityName(term.term())), "</strong>"),
      " at the stage <strong>", EscapeHtml(QuantityName(term.stage())), "</strong>");
  if (!term.law().empty()) absl::StrAppend(&html, ", ", LawHtml(term.law()));
  html += ".</p>\n";
  if (term.values().empty()) return html;
  // Terms without a curve list their coefficients.
  constexpr absl::string_view kCoefficients = "coefficient: ";
  if (absl::StartsWith(term.abscissa(), kCoefficients)) {
    const std::vector<std::string> names =
        absl::StrSplit(term.abscissa().substr(kCoefficients.size()), ", ");
    std::vector<std::vector<std::string>> rows;
    for (int i = 0; i < std::min<int>(term.values_size(), static_cast<int>(names.size())); ++i) {
      const std::string& name = names[static_cast<size_t>(i)];
      std::optional<double> error;
      if (!term.standard_errors().empty()) error = term.standard_errors(i);
      const bool needed = term.values(i) != 0 || error != 0.0;
      rows.push_back(
          {EscapeHtml(QuantityName(name)),
           needed ? EscapeHtml(QuantityWithError(name, term.values(i), error)) : "not needed"});
    }
    return html + PageTable({"coefficient", "value"}, rows, {0});
  }
  XyChart chart;
  chart.width = 900;
  chart.height = 320;
  const auto scaled = [](const std::string& name, const auto& numbers, ChartAxis* axis) {
    double largest = 0;
    for (const double value : numbers) {
      if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
    }
    const ShownUnit unit = ShownUnitOf(name, largest);
    axis->title = QuantityName(name);
    if (!unit.name.empty()) absl::StrAppend(&axis->title, " [", unit.name, "]");
    return unit.per_named;
  };
  const double x_factor = scaled(term.abscissa(), term.abscissa_values(), &chart.x);
  const double y_factor = scaled(term.ordinate(), term.values(), &chart.y);
  // Decades, as of exposure times, need a logarithmic axis.
  double least = INFINITY, most = 0;
  for (const double x : term.abscissa_values()) {
    if (x > 0) least = std::min(least, x);
    most = std::max(most, x);
  }
  chart.x.logarithmic = most >= 1e3 * least && *std::min_element(term.abscissa_values().begin(),
                                                                 term.abscissa_values().end()) >= 0;
  ChartSeries curve{"model", SeriesMark::kLineAndDots, {}, {}, {}, {}};
  for (const double x : term.abscissa_values()) curve.x.push_back(x_factor * x);
  for (const double y : term.values()) curve.y.push_back(y_factor * y);
  for (const double error : term.standard_errors()) curve.half_band.push_back(2 * y_factor * error);
  chart.series.push_back(std::move(curve));
  return absl::StrCat(
      html, XyChartSvg(chart),
      term.standard_errors().empty() ? "" : SoftParagraph("Shaded: \u00b1 2 standard errors."));
}

}  // namespace sightline
