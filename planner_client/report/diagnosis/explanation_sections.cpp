// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/diagnosis/explanation_sections.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "planner_client/report/diagnosis/diagnosis_text.h"
#include "planner_client/report/diagnosis/diagnosis_view.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"
#include "planner_client/report/recordings/recording_text.h"

namespace sightline {
namespace {

std::string ParameterText(const v1::FittedParameter& parameter) {
  std::string html = absl::StrCat(EscapeHtml(QuantityName(parameter.name())), " ");
  if (!parameter.has_standard_error() && !(parameter.lower() < parameter.upper())) {
    return absl::StrCat(html, "<span class=\"soft\">not determined by these recordings</span>");
  }
  std::optional<double> error;
  if (parameter.has_standard_error()) error = parameter.standard_error();
  absl::StrAppend(&html, "<strong>",
                  EscapeHtml(QuantityWithError(parameter.name(), parameter.value(), error)),
                  "</strong>");
  if (parameter.lower() < parameter.upper()) {
    absl::StrAppend(
        &html, " <span class=\"soft nowrap\">(", error.has_value() ? "95\u202f%: " : "",
        EscapeHtml(QuantityInterval(parameter.name(), parameter.lower(), parameter.upper())),
        ")</span>");
  }
  return html;
}

}  // namespace

std::string ExplanationsHtml(const DiagnosisView& view) {
  if (view.diagnosis.ranked().empty()) return "";
  std::vector<std::vector<std::string>> rows;
  double sum = 0;
  for (const v1::Explanation& explanation : view.diagnosis.ranked()) {
    sum += explanation.probability();
    const bool named = explanation.effect() != "none" && explanation.effect() != "unknown";
    std::vector<std::string> ids, stages, parameters;
    for (const v1::FittedEffect& effect : explanation.effects()) {
      ids.push_back(CodeHtml(effect.effect()));
      for (const v1::FittedParameter& parameter : effect.parameters()) {
        parameters.push_back(absl::StrCat(
            "<span class=\"parameter\">",
            explanation.effects_size() > 1 ? EscapeHtml(EffectTitle(effect.effect())) + ": " : "",
            ParameterText(parameter), "</span>"));
      }
    }
    if (ids.empty() && named) ids.push_back(CodeHtml(explanation.effect()));
    std::string name = absl::StrCat("<span class=\"effect\">",
                                    EscapeHtml(ExplanationTitle(explanation)), "</span>");
    std::string detail = absl::StrJoin(ids, " + ");
    if (!explanation.stage().empty() && explanation.stage() != "none") {
      absl::StrAppend(&detail, detail.empty() ? "" : ", ", "stage ",
                      EscapeHtml(explanation.stage()));
    }
    if (!detail.empty()) absl::StrAppend(&name, "<span class=\"detail\">", detail, "</span>");
    const double chi = explanation.held_out_chi_squared_per_dof();
    std::string last = absl::StrJoin(parameters, "<br>");
    if (!explanation.reason().empty()) {
      absl::StrAppend(&last, "<span class=\"detail\">", EscapeHtml(explanation.reason()),
                      "</span>");
    }
    rows.push_back({name, ProbabilityBar(explanation.probability()),
                    GainText(explanation.log_evidence_gain()), chi > 0 ? Number(chi) : "\u2013",
                    last});
  }
  if (1 - sum > 0.0005) {
    rows.push_back({"<span class=\"soft\">all others</span>", ProbabilityBar(1 - sum), "", "", ""});
  }
  std::string html =
      PageTable({"explanation", "probability", "gain in log evidence<br>over nominal [nats]",
                 "\u03c7\u00b2/dof,<br>held out", "fitted values, and why (not)"},
                rows, {0, 1, 4});
  html += SoftParagraph(
      "Log evidence: how much better an explanation predicts these recordings than the nominal "
      "description fitted again, its freedom taken into account. 3 nats are odds of 20 to 1.");
  if (!view.diagnosis.same_class().empty()) {
    std::vector<std::string> names;
    double together = 0;
    for (const v1::Explanation& explanation : view.diagnosis.ranked()) {
      const auto& same = view.diagnosis.same_class();
      if (&explanation == &view.diagnosis.ranked(0) ||
          std::find(same.begin(), same.end(), explanation.effect()) != same.end()) {
        together += explanation.probability();
      }
    }
    for (const std::string& id : view.diagnosis.same_class()) {
      names.push_back(
          absl::StrCat("<strong>", EscapeHtml(EffectTitle(id)), "</strong> (", CodeHtml(id), ")"));
    }
    absl::StrAppend(
        &html, "<h3>Cannot be told apart</h3>\n<p>These recordings cannot tell <strong>",
        EscapeHtml(ExplanationTitle(view.diagnosis.ranked(0))), "</strong> from ",
        absl::StrJoin(names, ", "), ": all of them change these images alike. Together they have ",
        EscapeHtml(ProbabilityText(together)), ".</p>\n");
  }
  return html;
}

std::string NextRecordingsHtml(const DiagnosisView& view) {
  if (view.diagnosis.next_recordings().empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const v1::NextRecording& next : view.diagnosis.next_recordings()) {
    const std::string setup = RecordingSetup(next.recording());
    std::vector<std::string> apart;
    for (const std::string& id : next.tells_apart()) apart.push_back(EscapeHtml(EffectTitle(id)));
    rows.push_back(
        {next.description().empty() ? absl::StrCat("<strong>", EscapeHtml(setup), "</strong>")
                                    : EscapeHtml(next.description()),
         next.description().empty() ? "" : EscapeHtml(setup),
         absl::StrCat("<strong>", Number(next.expected_gain_bits(), 2), "</strong> bits"),
         absl::StrJoin(apart, ", ")});
  }
  return PageTable({"recording", "settings", "expected gain", "tells apart"}, rows, {0, 1, 3});
}

std::string PowerHtml(const DiagnosisView& view) {
  if (view.diagnosis.power().empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const v1::DetectableStrength& power : view.diagnosis.power()) {
    std::string found;
    if (!view.diagnosis.ranked().empty()) {
      for (const v1::FittedEffect& effect : view.diagnosis.ranked(0).effects()) {
        if (effect.effect() != power.effect()) continue;
        for (const v1::FittedParameter& parameter : effect.parameters()) {
          if (parameter.name() == power.parameter()) {
            found = absl::StrCat("<strong>",
                                 EscapeHtml(QuantityText(parameter.name(), parameter.value())),
                                 "</strong>");
          }
        }
      }
    }
    rows.push_back({absl::StrCat("<span class=\"effect\">", EscapeHtml(EffectTitle(power.effect())),
                                 "</span>"),
                    EscapeHtml(QuantityName(power.parameter())),
                    EscapeHtml(QuantityText(power.parameter(), power.strength(), 2)), found,
                    EscapeHtml(power.unit_note())});
  }
  return SoftParagraph(
             "The strength of each effect at which these recordings would, on average, raise the "
             "log-likelihood by 5 over the nominal description fitted again. Anything weaker may "
             "be "
             "there unseen.") +
         PageTable({"effect", "parameter", "seen from", "found", ""}, rows, {0, 1, 4});
}

}  // namespace sightline
