// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/diagnosis/diagnosis_report.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "planner_client/report/diagnosis/check_sizes.h"
#include "planner_client/report/diagnosis/diagnosis_text.h"
#include "planner_client/report/diagnosis/diagnosis_view.h"
#include "planner_client/report/diagnosis/explanation_sections.h"
#include "planner_client/report/diagnosis/fit_sections.h"
#include "planner_client/report/diagnosis/image_sections.h"
#include "planner_client/report/diagnosis/missing_term_sections.h"
#include "planner_client/report/diagnosis/predictive_check.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"

namespace sightline {
namespace {

bool Interrupted(const DiagnosisView& view) { return view.diagnosis.verdict() == "interrupted"; }

std::string Heading(const DiagnosisView& view) {
  if (!view.diagnosis.finding().empty()) return view.diagnosis.finding();
  if (!view.has_model) return "The recordings agree with the nominal description.";
  return view.diagnosis.ranked().empty()
             ? "The recordings differ from the nominal description."
             : absl::StrCat(ExplanationTitle(view.diagnosis.ranked(0)), ".");
}

std::string VerdictSentence(const DiagnosisView& view) {
  if (Interrupted(view)) {
    return "<strong>Interrupted: this is no finding.</strong> What follows is of what was fitted "
           "until then.";
  }
  if (view.diagnosis.ranked().empty()) return "";
  const v1::Explanation& first = view.diagnosis.ranked(0);
  std::string html = absl::StrCat("<strong>", EscapeHtml(ExplanationTitle(first)),
                                  "</strong>, with a probability of ",
                                  EscapeHtml(ProbabilityText(first.probability())), ".");
  std::vector<std::string> regions, depends_on;
  for (const v1::FittedEffect& effect : first.effects()) {
    if (!effect.regions().empty()) regions.push_back(NameWords(effect.regions()));
    if (!effect.depends_on().empty()) depends_on.push_back(NameWords(effect.depends_on()));
  }
  if (!regions.empty()) {
    absl::StrAppend(&html, " It shows in: ", EscapeHtml(absl::StrJoin(regions, "; ")), ".");
  }
  if (!depends_on.empty()) {
    absl::StrAppend(&html, " It depends on: ", EscapeHtml(absl::StrJoin(depends_on, "; ")), ".");
  }
  return html;
}

std::vector<std::pair<std::string, std::string>> Figures(const DiagnosisView& view) {
  std::vector<std::pair<std::string, std::string>> figures;
  if (!view.diagnosis.verdict().empty()) {
    std::string value =
        view.diagnosis.verdict() == "none" ? "none" : EscapeHtml(view.diagnosis.verdict());
    for (const v1::Explanation& explanation : view.diagnosis.ranked()) {
      if (explanation.effect() != "none" || Interrupted(view)) continue;
      const double probability = view.diagnosis.verdict() == "none" ? explanation.probability()
                                                                    : 1 - explanation.probability();
      absl::StrAppend(&value, " <small>", EscapeHtml(ProbabilityText(probability)), "</small>");
    }
    figures.push_back({"verdict", value});
  }
  if (view.diagnosis.has_held_out_improvement()) {
    const v1::HeldOutImprovement& held_out = view.diagnosis.held_out_improvement();
    figures.push_back({"held-out \u03c7\u00b2/dof",
                       view.has_model
                           ? Change(Number(held_out.null()), Number(held_out.with_effect()))
                           : Number(held_out.null())});
  }
  if (view.diagnosis.has_model_fit() && view.diagnosis.model_fit().degrees_of_freedom() > 0) {
    figures.push_back({view.of_part ? "fit of held-out tiles" : "fit of all recordings",
                       EscapeHtml(PValueText(view.diagnosis.model_fit().p_value()))});
  }
  const int recordings = view.of_part ? view.diagnosis.calibrated().recordings_size()
                                      : std::max({view.diagnosis.calibrated().recordings_size(),
                                                  view.diagnosis.null_fit().recordings_size(),
                                                  view.diagnosis.model_fit().recordings_size()});
  if (recordings > 0) {
    figures.push_back(
        {"recordings", absl::StrCat(recordings, view.held_out.empty()
                                                    ? ""
                                                    : absl::StrCat(" <small>", view.held_out.size(),
                                                                   " held out</small>"))});
  }
  return figures;
}

std::string Provenance(const DiagnosisView& view) {
  std::string html = absl::StrCat(
      "<p>Set ", EscapeHtml(view.diagnosis.set().empty() ? "without a name" : view.diagnosis.set()),
      ", seed ", view.diagnosis.seed(), ".</p>\n");
  if (view.diagnosis.calibrated_effects().empty()) return html;
  absl::StrAppend(&html, "<p>Effects of the calibrated model:</p>\n<ul>");
  for (const v1::Effect& effect : view.diagnosis.calibrated_effects()) {
    // The order of a message's map is not fixed.
    const std::map<std::string, double> parameters(effect.parameters().begin(),
                                                   effect.parameters().end());
    std::vector<std::string> values;
    for (const auto& [name, value] : parameters) {
      values.push_back(absl::StrCat(name, " = ", NumberText(value)));
    }
    absl::StrAppend(&html, "<li>", CodeHtml(effect.effect()), values.empty() ? "" : ": ",
                    CodeHtml(absl::StrJoin(values, ", ")), "</li>\n");
  }
  return html + "</ul>\n";
}

std::string Html(const DiagnosisView& view) {
  const std::string set = view.diagnosis.set().empty() ? "Recordings" : view.diagnosis.set();
  StaticPage page;
  page.title = absl::StrCat(set, " \u2013 diagnosis");
  page.kicker = absl::StrCat("Sightline \u00b7 diagnosis of ", set);
  page.heading = Heading(view);
  page.finding_html = VerdictSentence(view);
  page.figures = Figures(view);
  page.warnings.assign(view.diagnosis.warnings().begin(), view.diagnosis.warnings().end());
  if (Interrupted(view)) {
    page.warnings.insert(page.warnings.begin(),
                         "The diagnosis was interrupted: probabilities and values are of what was "
                         "compared until then. What was not compared may explain more.");
  }
  const char* picture = view.has_model ? "The picture that shows it" : "Recorded and expected";
  page.sections_html =
      PageSection("profiles", picture, ProfilesHtml(view)) +
      PageSection("maps", view.of_part ? picture : "Where in the image", RegionMapsHtml(view)) +
      PageSection("explanations", "What explains it, and what does not", ExplanationsHtml(view)) +
      PageSection("next", "What to record next", NextRecordingsHtml(view)) +
      PageSection("fit", "How well the model fits", FitHtml(view)) +
      PageSection("prediction", "Does it predict?",
                  PredictiveCheckHtml(view.diagnosis, view.NamedModel())) +
      PageSection("setup", "The set-up, fitted again", DeviationsHtml(view)) +
      PageSection("stages", "Where in the chain", StagesHtml(view)) +
      PageSection("laws", "What it grows with", LawsHtml(view)) +
      PageSection("free-form", "The missing term", FreeFormHtml(view)) +
      PageSection("power", "What these recordings could have shown", PowerHtml(view)) +
      PageSection("provenance", "How to get this again", Provenance(view));
  return StaticPageHtml(page);
}

}  // namespace

absl::StatusOr<std::string> RenderDiagnosisReport(const v1::Diagnosis& diagnosis,
                                                  const std::string& set_folder) {
  if (absl::Status status = CheckSizes(diagnosis); !status.ok()) return status;
  return Html(DiagnosisView(diagnosis, set_folder));
}

absl::Status WriteDiagnosisReport(const v1::Diagnosis& diagnosis, const std::string& set_folder,
                                  const std::string& path) {
  const absl::StatusOr<std::string> html = RenderDiagnosisReport(diagnosis, set_folder);
  if (!html.ok()) return html.status();
  return WriteFileAtomically(path, *html);
}

}  // namespace sightline
