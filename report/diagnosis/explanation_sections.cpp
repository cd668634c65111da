// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/explanation_sections.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "report/diagnosis/diagnosis_text.h"
#include "report/page/number_text.h"
#include "report/recordings/recording_text.h"

namespace sightline {
namespace {

std::string FittedText(const v1::FittedParameter& parameter) {
  const std::string name = QuantityName(parameter.name());
  const bool has_interval = parameter.lower() < parameter.upper();
  if (!parameter.has_standard_error() && !has_interval) {
    return absl::StrCat(name, " not determined by these recordings");
  }
  std::optional<double> error;
  if (parameter.has_standard_error()) error = parameter.standard_error();
  std::string text =
      absl::StrCat(name, " ", QuantityWithError(parameter.name(), parameter.value(), error));
  if (has_interval) {
    absl::StrAppend(&text, " (", error.has_value() ? "95\u202f%: " : "",
                    QuantityInterval(parameter.name(), parameter.lower(), parameter.upper()), ")");
  }
  return text;
}

v1::ReportCell GainCell(double nats) { return NumberCell(nats, GainText(nats)); }

// The terms of every explanation's evidence, in a folded block; empty if there are none.
ReportBlocks EvidenceTerms(const v1::Diagnosis& diagnosis) {
  std::vector<ReportCells> rows;
  for (const v1::Explanation& explanation : diagnosis.ranked()) {
    if (!explanation.has_evidence()) continue;
    const v1::Evidence& terms = explanation.evidence();
    rows.push_back({TextCell(ExplanationTitle(explanation)), GainCell(terms.fit_nats()),
                    GainCell(terms.covariance_nats()), GainCell(terms.curvature_nats()),
                    GainCell(terms.parameter_prior_nats()), GainCell(terms.model_prior_nats())});
  }
  if (rows.empty()) return {};
  std::vector<v1::ReportColumn> columns = {WordsColumn("explanation")};
  for (const char* term : {"fit of the data", "covariance of the data", "curvature at the best fit",
                           "prior of the parameters", "prior of the explanation"}) {
    columns.push_back(NumberColumn(term, "nats"));
  }
  return {FoldedBlock("The evidence, term by term",
                      {TableBlock("The evidence, term by term", columns, rows),
                       RemarkBlock("Each over that of the nominal description fitted again. The "
                                   "first four make up the gain in log evidence.")})};
}

ReportCells ExplanationRow(const v1::Explanation& explanation) {
  const bool named = explanation.effect() != "none" && explanation.effect() != "unknown";
  std::vector<std::string> ids, parameters;
  for (const v1::FittedEffect& effect : explanation.effects()) {
    ids.push_back(effect.effect());
    for (const v1::FittedParameter& parameter : effect.parameters()) {
      parameters.push_back(
          absl::StrCat(explanation.effects_size() > 1 ? EffectTitle(effect.effect()) + ": " : "",
                       FittedText(parameter)));
    }
  }
  if (ids.empty() && named) ids.push_back(explanation.effect());
  std::string detail = absl::StrJoin(ids, " + ");
  if (!explanation.stage().empty() && explanation.stage() != "none") {
    absl::StrAppend(&detail, detail.empty() ? "" : ", ", "stage ", explanation.stage());
  }
  const double chi = explanation.held_out_chi_squared_per_dof();
  return {StrongCell(ExplanationTitle(explanation), detail),
          ShareCell(explanation.probability(), ProbabilityText(explanation.probability())),
          GainCell(explanation.log_evidence_gain()),
          chi > 0 ? NumberCell(chi, Number(chi)) : TextCell(kNoValue),
          TextCell(absl::StrJoin(parameters, "\n"), explanation.reason())};
}

// Effects that cause the same change of these images.
v1::ReportBlock SameClass(const v1::Diagnosis& diagnosis) {
  std::vector<v1::ReportRun> runs = {PlainRun("These recordings cannot tell "),
                                     StrongRun(ExplanationTitle(diagnosis.ranked(0))),
                                     PlainRun(" from ")};
  double together = 0;
  const auto& same = diagnosis.same_class();
  for (const v1::Explanation& explanation : diagnosis.ranked()) {
    if (&explanation == &diagnosis.ranked(0) ||
        std::find(same.begin(), same.end(), explanation.effect()) != same.end()) {
      together += explanation.probability();
    }
  }
  for (int i = 0; i < same.size(); ++i) {
    if (i > 0) runs.push_back(PlainRun(", "));
    runs.push_back(StrongRun(EffectTitle(same[i])));
    runs.push_back(PlainRun(" ("));
    runs.push_back(CodeRun(same[i]));
    runs.push_back(PlainRun(")"));
  }
  runs.push_back(
      PlainRun(absl::StrCat(": all of them change these images alike. Together they have ",
                            ProbabilityText(together), ".")));
  return TitledBlock("Cannot be told apart", {ParagraphBlock(runs)});
}

}  // namespace

ReportBlocks ExplanationBlocks(const DiagnosisView& view) {
  if (view.diagnosis.ranked().empty()) return {};
  std::vector<ReportCells> rows;
  double sum = 0;
  for (const v1::Explanation& explanation : view.diagnosis.ranked()) {
    sum += explanation.probability();
    rows.push_back(ExplanationRow(explanation));
  }
  if (1 - sum > 0.0005) {
    rows.push_back({TextCell("all others"), ShareCell(1 - sum, ProbabilityText(1 - sum)),
                    TextCell(""), TextCell(""), TextCell("")});
  }
  ReportBlocks blocks = {
      TableBlock(
          "Explanations",
          {WordsColumn("explanation"), ShareColumn("probability"),
           NumberColumn("gain in log evidence over nominal", "nats"),
           NumberColumn("\u03c7\u00b2/dof, held out"), WordsColumn("fitted values, and why (not)")},
          rows),
      RemarkBlock(
          "Log evidence: how much better an explanation predicts these recordings than the nominal "
          "description fitted again, its freedom taken into account. 3 nats are odds of 20 to 1.")};
  for (v1::ReportBlock& block : EvidenceTerms(view.diagnosis)) blocks.push_back(std::move(block));
  if (!view.diagnosis.same_class().empty()) blocks.push_back(SameClass(view.diagnosis));
  return blocks;
}

ReportBlocks NextRecordingBlocks(const DiagnosisView& view) {
  if (view.diagnosis.next_recordings().empty()) return {};
  std::vector<ReportCells> rows;
  for (const v1::NextRecording& next : view.diagnosis.next_recordings()) {
    const std::string setup = RecordingSetup(next.recording());
    std::vector<std::string> apart;
    for (const std::string& id : next.tells_apart()) apart.push_back(EffectTitle(id));
    const bool described = !next.description().empty();
    rows.push_back({described ? TextCell(next.description()) : StrongCell(setup),
                    TextCell(described ? setup : ""),
                    NumberCell(next.expected_gain_bits(), Number(next.expected_gain_bits(), 2)),
                    TextCell(absl::StrJoin(apart, ", "))});
  }
  return {TableBlock("Recordings to make next",
                     {WordsColumn("recording"), WordsColumn("settings"),
                      NumberColumn("expected gain", "bits"), WordsColumn("tells apart")},
                     rows)};
}

ReportBlocks PowerBlocks(const DiagnosisView& view) {
  if (view.diagnosis.power().empty()) return {};
  std::vector<ReportCells> rows;
  for (const v1::DetectableStrength& power : view.diagnosis.power()) {
    v1::ReportCell found = TextCell("");
    if (!view.diagnosis.ranked().empty()) {
      for (const v1::FittedEffect& effect : view.diagnosis.ranked(0).effects()) {
        if (effect.effect() != power.effect()) continue;
        for (const v1::FittedParameter& parameter : effect.parameters()) {
          if (parameter.name() != power.parameter()) continue;
          found = QuantityCell(parameter.name(), parameter.value());
          found.set_strong(true);
        }
      }
    }
    rows.push_back({StrongCell(EffectTitle(power.effect())),
                    TextCell(QuantityName(power.parameter())),
                    QuantityCell(power.parameter(), power.strength(), 2), std::move(found),
                    TextCell(power.unit_note())});
  }
  return {RemarkBlock(
              "The strength of each effect at which these recordings would, on average, raise the "
              "log-likelihood by 5 over the nominal description fitted again. Anything weaker may "
              "be there unseen."),
          TableBlock("Detectable strengths",
                     {WordsColumn("effect"), WordsColumn("parameter"), NumberColumn("seen from"),
                      NumberColumn("found"), WordsColumn("remark")},
                     rows)};
}

}  // namespace sightline
