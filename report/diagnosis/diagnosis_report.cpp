// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/diagnosis_report.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "report/diagnosis/check_sizes.h"
#include "report/diagnosis/diagnosis_text.h"
#include "report/diagnosis/diagnosis_view.h"
#include "report/diagnosis/explanation_sections.h"
#include "report/diagnosis/fit_sections.h"
#include "report/diagnosis/image_sections.h"
#include "report/diagnosis/missing_term_sections.h"
#include "report/diagnosis/predictive_check.h"
#include "report/document/report_page.h"
#include "report/document/report_parts.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

bool Interrupted(const DiagnosisView& view) { return view.diagnosis.verdict() == "interrupted"; }

std::string DiagnosisHeading(const DiagnosisView& view) {
  // A second line stands below the heading (AddFurtherLines).
  if (!view.diagnosis.finding().empty()) {
    return view.diagnosis.finding().substr(0, view.diagnosis.finding().find('\n'));
  }
  if (!view.has_model) return "The recordings agree with the nominal description.";
  return view.diagnosis.ranked().empty()
             ? "The recordings differ from the nominal description."
             : absl::StrCat(ExplanationTitle(view.diagnosis.ranked(0)), ".");
}

void AddVerdict(const DiagnosisView& view, v1::Report* report) {
  const auto add = [&](const v1::ReportRun& run) { *report->add_finding() = run; };
  if (Interrupted(view)) {
    add(StrongRun("Interrupted: this is no finding."));
    add(PlainRun(" What follows is of what was fitted until then."));
    return;
  }
  if (view.diagnosis.ranked().empty()) return;
  const v1::Explanation& first = view.diagnosis.ranked(0);
  add(StrongRun(ExplanationTitle(first)));
  std::string rest =
      absl::StrCat(", with a probability of ", ProbabilityText(first.probability()), ".");
  std::vector<std::string> regions, depends_on;
  for (const v1::FittedEffect& effect : first.effects()) {
    if (!effect.regions().empty()) regions.push_back(NameWords(effect.regions()));
    if (!effect.depends_on().empty()) depends_on.push_back(NameWords(effect.depends_on()));
  }
  if (!regions.empty()) absl::StrAppend(&rest, " It shows in: ", absl::StrJoin(regions, "; "), ".");
  if (!depends_on.empty()) {
    absl::StrAppend(&rest, " It depends on: ", absl::StrJoin(depends_on, "; "), ".");
  }
  add(PlainRun(rest));
}

// Further lines of the finding: the remainder of the answer, and the appearance of unknown physics.
void AddFurtherLines(const DiagnosisView& view, v1::Report* report) {
  const std::string& finding = view.diagnosis.finding();
  const size_t end = finding.find('\n');
  if (end == std::string::npos) return;
  *report->add_finding() = PlainRun(absl::StrCat(" ", finding.substr(end + 1)));
}

v1::ReportFact VerdictFact(const DiagnosisView& view) {
  const v1::Diagnosis& diagnosis = view.diagnosis;
  for (const v1::Explanation& explanation : diagnosis.ranked()) {
    if (explanation.effect() != "none" || Interrupted(view)) continue;
    return TextFact("verdict", diagnosis.verdict(),
                    ProbabilityText(diagnosis.verdict() == "none" ? explanation.probability()
                                                                  : 1 - explanation.probability()));
  }
  return TextFact("verdict", diagnosis.verdict());
}

void AddDiagnosisFigures(const DiagnosisView& view, v1::Report* report) {
  const v1::Diagnosis& diagnosis = view.diagnosis;
  if (!diagnosis.verdict().empty()) *report->add_figures() = VerdictFact(view);
  if (diagnosis.has_held_out_improvement()) {
    const v1::HeldOutImprovement& held_out = diagnosis.held_out_improvement();
    *report->add_figures() = NumberFact(
        "held-out \u03c7\u00b2/dof", view.has_model ? held_out.with_effect() : held_out.null(), "",
        view.has_model ? Change(Number(held_out.null()), Number(held_out.with_effect()))
                       : Number(held_out.null()));
  }
  if (diagnosis.has_model_fit() && diagnosis.model_fit().degrees_of_freedom() > 0) {
    const double p_value = diagnosis.model_fit().p_value();
    *report->add_figures() =
        NumberFact(view.of_part ? "fit of held-out tiles" : "fit of all recordings", p_value, "",
                   PValueText(p_value));
  }
  const int recordings = view.of_part ? diagnosis.calibrated().recordings_size()
                                      : std::max({diagnosis.calibrated().recordings_size(),
                                                  diagnosis.null_fit().recordings_size(),
                                                  diagnosis.model_fit().recordings_size()});
  if (recordings == 0) return;
  *report->add_figures() =
      NumberFact("recordings", recordings, "", absl::StrCat(recordings),
                 view.held_out.empty() ? "" : absl::StrCat(view.held_out.size(), " held out"));
}

ReportBlocks ProvenanceBlocks(const v1::Diagnosis& diagnosis) {
  ReportBlocks blocks = {
      TextBlock(absl::StrCat("Set ", diagnosis.set().empty() ? "without a name" : diagnosis.set(),
                             ", seed ", diagnosis.seed(), "."))};
  if (diagnosis.calibrated_effects().empty()) return blocks;
  std::vector<std::vector<v1::ReportRun>> items;
  for (const v1::Effect& effect : diagnosis.calibrated_effects()) {
    // The order of a message's map is not fixed.
    const std::map<std::string, double> parameters(effect.parameters().begin(),
                                                   effect.parameters().end());
    std::vector<std::string> values;
    for (const auto& [name, value] : parameters) {
      values.push_back(absl::StrCat(name, " = ", NumberText(value)));
    }
    items.push_back({CodeRun(effect.effect())});
    if (values.empty()) continue;
    items.back().push_back(PlainRun(": "));
    items.back().push_back(CodeRun(absl::StrJoin(values, ", ")));
  }
  blocks.push_back(TextBlock("Effects of the calibrated model:"));
  blocks.push_back(ListBlock(items));
  return blocks;
}

}  // namespace

absl::StatusOr<v1::Report> DiagnosisReport(const v1::Diagnosis& diagnosis,
                                           const std::string& set_folder) {
  SIGHTLINE_RETURN_IF_ERROR(CheckSizes(diagnosis));
  const DiagnosisView view(diagnosis, set_folder);
  const std::string set = diagnosis.set().empty() ? "Recordings" : diagnosis.set();
  v1::Report report;
  report.set_title(absl::StrCat(set, " \u2013 diagnosis"));
  report.set_kind("diagnosis");
  report.set_subject(absl::StrCat("Sightline \u00b7 diagnosis of ", set));
  report.set_heading(DiagnosisHeading(view));
  AddVerdict(view, &report);
  AddFurtherLines(view, &report);
  AddDiagnosisFigures(view, &report);
  if (Interrupted(view)) {
    report.add_warnings(
        "The diagnosis was interrupted: probabilities and values are of what was compared until "
        "then. What was not compared may explain more.");
  }
  report.mutable_warnings()->MergeFrom(diagnosis.warnings());
  const char* picture = view.has_model ? "The picture that shows it" : "Recorded and expected";
  AddSection(&report, "profiles", picture, ProfileBlocks(view));
  AddSection(&report, "maps", view.of_part ? picture : "Where in the image", RegionMapBlocks(view));
  AddSection(&report, "explanations", "What explains it, and what does not",
             ExplanationBlocks(view));
  AddSection(&report, "next", "What to record next", NextRecordingBlocks(view));
  AddSection(&report, "fit", "How well the model fits", FitBlocks(view));
  AddSection(&report, "prediction", "Does it predict?",
             PredictiveCheckBlocks(diagnosis, view.NamedModel()));
  AddSection(&report, "setup", "The set-up, fitted again", DeviationBlocks(view));
  AddSection(&report, "stages", "Where in the chain", StageBlocks(view));
  AddSection(&report, "laws", "What it grows with", LawBlocks(view));
  AddSection(&report, "free-form", "The missing term", FreeFormBlocks(view));
  AddSection(&report, "power", "What these recordings could have shown", PowerBlocks(view));
  AddSection(&report, "provenance", "How to get this again", ProvenanceBlocks(diagnosis));
  return report;
}

absl::Status WriteDiagnosisReport(const v1::Diagnosis& diagnosis, const std::string& set_folder,
                                  const std::string& path) {
  SIGHTLINE_ASSIGN_OR_RETURN(const v1::Report report, DiagnosisReport(diagnosis, set_folder));
  return WriteReport(report, path);
}

}  // namespace sightline
