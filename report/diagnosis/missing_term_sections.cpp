// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/missing_term_sections.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "report/diagnosis/diagnosis_text.h"
#include "report/document/report_series.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

// Terms without a curve list their coefficients in the name of the abscissa.
constexpr absl::string_view kCoefficients = "coefficient: ";

v1::ReportBlock CoefficientTable(const v1::FreeFormTerm& term) {
  const std::vector<std::string> names =
      absl::StrSplit(term.abscissa().substr(kCoefficients.size()), ", ");
  std::vector<ReportCells> rows;
  for (int i = 0; i < std::min<int>(term.values_size(), static_cast<int>(names.size())); ++i) {
    const std::string& name = names[static_cast<size_t>(i)];
    std::optional<double> error;
    if (!term.standard_errors().empty()) error = term.standard_errors(i);
    const bool needed = term.values(i) != 0 || error != 0.0;
    v1::ReportCell value = QuantityCell(name, term.values(i));
    value.set_text(needed ? QuantityWithError(name, term.values(i), error) : "not needed");
    rows.push_back({TextCell(QuantityName(name)), std::move(value)});
  }
  return TableBlock("Coefficients of the missing term",
                    {WordsColumn("coefficient"), NumberColumn("value")}, rows);
}

// Axis of a quantity in a unit that suits its values, and the factor from the unit in its name to
// that unit.
double ScaledAxis(const std::string& name, const google::protobuf::RepeatedField<double>& numbers,
                  v1::ReportAxis* axis) {
  double largest = 0;
  for (const double value : numbers) {
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  }
  const ShownUnit unit = ShownUnitOf(name, largest);
  *axis = AxisOf(QuantityName(name), unit.name);
  return unit.per_named;
}

v1::ReportBlock FreeFormChart(const v1::FreeFormTerm& term) {
  v1::ReportChart chart;
  const double x_factor = ScaledAxis(term.abscissa(), term.abscissa_values(), chart.mutable_x());
  const double y_factor = ScaledAxis(term.ordinate(), term.values(), chart.mutable_y());
  // Decades, as of exposure times, need a logarithmic axis.
  double least = INFINITY, most = 0;
  for (const double x : term.abscissa_values()) {
    if (x > 0) least = std::min(least, x);
    most = std::max(most, x);
  }
  chart.mutable_x()->set_logarithmic(
      most >= 1e3 * least &&
      *std::min_element(term.abscissa_values().begin(), term.abscissa_values().end()) >= 0);
  v1::ReportSeries curve =
      EmptySeries("", v1::REPORT_COLOUR_MODEL, v1::ReportSeries::LINE_AND_DOTS);
  std::vector<double> half_widths;
  for (int i = 0; i < term.values_size(); ++i) {
    AddPoint(x_factor * term.abscissa_values(i), y_factor * term.values(i), &curve);
  }
  for (const double error : term.standard_errors()) half_widths.push_back(2 * y_factor * error);
  AddBand("\u00b1 2 standard errors", half_widths, &curve);
  *chart.add_series() = std::move(curve);
  return ChartBlock(std::move(chart));
}

// Gain at settings that the stage's functions predict without being fitted to them.
v1::ReportCell TransferCell(const v1::StageEvidence& stage) {
  if (!stage.has_transfer_gain()) return TextCell("not asked");
  return NumberCell(stage.transfer_gain(), GainText(stage.transfer_gain()), "",
                    absl::StrCat(FixedNumber(stage.transfer_behind(), 1), " \u00b1 ",
                                 FixedNumber(stage.transfer_behind_standard_error(), 1),
                                 " nats behind the best stage"));
}

std::string StageRemark(const v1::Diagnosis& diagnosis, bool transfer) {
  std::string remark = "How well a free term at one stage absorbs what is left.";
  if (!transfer) return remark;
  absl::StrAppend(&remark,
                  " Last column: the best models that act at the stage are fitted at half of the "
                  "values of each setting and predict the other half.");
  if (diagnosis.located_stages_size() > 1) {
    absl::StrAppend(&remark, " Located: ", QuantityName(diagnosis.located_stages(0)), " or ",
                    QuantityName(diagnosis.located_stages(1)), ".");
  }
  return remark;
}

}  // namespace

ReportBlocks StageBlocks(const DiagnosisView& view) {
  const auto& stages = view.diagnosis.stages();
  if (stages.empty()) return {};
  const bool transfer = std::any_of(stages.begin(), stages.end(), [](const v1::StageEvidence& s) {
    return s.has_transfer_gain();
  });
  std::vector<ReportCells> rows;
  for (const v1::StageEvidence& stage : stages) {
    rows.push_back({StrongCell(QuantityName(stage.stage())),
                    ShareCell(stage.probability(), ProbabilityText(stage.probability())),
                    NumberCell(stage.log_evidence_gain(), GainText(stage.log_evidence_gain()))});
    if (transfer) rows.back().push_back(TransferCell(stage));
  }
  std::vector<v1::ReportColumn> columns = {WordsColumn("stage"), ShareColumn("probability"),
                                           NumberColumn("gain in log evidence", "nats")};
  if (transfer) columns.push_back(NumberColumn("gain at settings held out", "nats"));
  return {RemarkBlock(StageRemark(view.diagnosis, transfer)), TableBlock("Stages", columns, rows)};
}

ReportBlocks LawBlocks(const DiagnosisView& view) {
  if (view.diagnosis.laws().empty()) return {};
  // A single entry stating that there is no dependence.
  if (view.diagnosis.laws_size() == 1 && view.diagnosis.laws(0).quantity() == "none") {
    return {TextBlock(LawText(view.diagnosis.laws(0).law()))};
  }
  std::vector<ReportCells> rows;
  for (const v1::SetupLaw& law : view.diagnosis.laws()) {
    rows.push_back(
        {StrongCell(QuantityName(law.quantity())), TextCell(LawText(law.law())),
         law.exponent() == 0 && law.exponent_standard_error() == 0
             ? TextCell(kNoValue)
             : NumberCell(law.exponent(), QuantityWithError("exponent", law.exponent(),
                                                            law.exponent_standard_error())),
         ShareCell(law.explained(), ProbabilityText(law.explained()))});
  }
  return {TableBlock("Dependence on the set-up",
                     {WordsColumn("quantity"), WordsColumn("law"), NumberColumn("exponent"),
                      ShareColumn("part of the residual it explains")},
                     rows)};
}

namespace {

ReportBlocks TermBlocks(const v1::FreeFormTerm& term) {
  std::vector<v1::ReportRun> runs = {PlainRun("A term")};
  if (!term.term().empty()) {
    runs.push_back(PlainRun(" of the kind "));
    runs.push_back(StrongRun(QuantityName(term.term())));
  }
  runs.push_back(PlainRun(" at the stage "));
  runs.push_back(StrongRun(QuantityName(term.stage())));
  runs.push_back(PlainRun(term.law().empty() ? "." : absl::StrCat(", ", LawText(term.law()), ".")));
  ReportBlocks blocks = {ParagraphBlock(runs)};
  if (term.values().empty()) return blocks;
  blocks.push_back(absl::StartsWith(term.abscissa(), kCoefficients) ? CoefficientTable(term)
                                                                    : FreeFormChart(term));
  return blocks;
}

}  // namespace

ReportBlocks FreeFormBlocks(const DiagnosisView& view) {
  if (!view.diagnosis.has_free_form()) return {};
  ReportBlocks blocks = TermBlocks(view.diagnosis.free_form());
  for (const v1::FreeFormTerm& term : view.diagnosis.further_free_forms()) {
    for (v1::ReportBlock& block : TermBlocks(term)) blocks.push_back(std::move(block));
  }
  return blocks;
}

}  // namespace sightline
