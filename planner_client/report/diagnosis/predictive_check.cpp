// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/diagnosis/predictive_check.h"

#include <map>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"

namespace sightline {
namespace {

// Below it a prediction is not believed to have failed by chance; the diagnosis asks for the same.
constexpr double kRejected = 0.01;

std::string PerNumber(const v1::PredictedGroup& group) {
  if (group.degrees_of_freedom() <= 0) return "\u2013";
  return absl::StrCat(Number(group.chi_squared() / group.degrees_of_freedom()), " <small>",
                      EscapeHtml(PValueText(group.p_value())), "</small>");
}

// What a check says as a whole: "the prediction holds (p = 0.43)".
std::string Outcome(const v1::PredictiveCheck& check) {
  return absl::StrCat(check.p_value() < kRejected ? "the prediction fails" : "the prediction holds",
                      " (", EscapeHtml(PValueText(check.p_value())), ")");
}

}  // namespace

std::string PredictiveCheckHtml(const v1::Diagnosis& diagnosis, const std::string& named_model) {
  const v1::PredictiveCheck &null = diagnosis.null_check(), &named = diagnosis.named_check();
  if (null.groups().empty() && named.groups().empty()) return "";
  const bool with_model = !named_model.empty() && !named.groups().empty();
  std::string text = absl::StrCat(
      "<p class=\"soft\">A name is given only if its model predicts recordings that it was not "
      "fitted to: each from a fit to three quarters of the others. Nominal description, fitted "
      "again: ",
      Outcome(null));
  if (with_model) {
    absl::StrAppend(&text, "; ", EscapeHtml(named_model), ": ", Outcome(named),
                    ", log density of the recordings ", named.log_score_gain() < 0 ? "" : "+",
                    EscapeHtml(FixedNumber(named.log_score_gain(), 1)), " nats");
  }
  text += ". p is the probability of the worst group, times their number.</p>\n";
  if (!diagnosis.part_of_it().empty()) {
    std::vector<std::string> parts;
    for (const v1::FittedEffect& effect : diagnosis.part_of_it()) {
      parts.push_back(EscapeHtml(EffectTitle(effect.effect())));
    }
    absl::StrAppend(&text, "<p>A part of what is missing: ", absl::StrJoin(parts, ", "),
                    ". It makes predictions better, but they fail all the same.</p>\n");
  }
  std::map<std::string, const v1::PredictedGroup*> with_name;
  for (const v1::PredictedGroup& group : named.groups()) with_name[group.name()] = &group;
  std::vector<std::vector<std::string>> rows;
  for (const v1::PredictedGroup& group : null.groups()) {
    std::vector<std::string> row = {EscapeHtml(group.name()), PerNumber(group)};
    if (with_model) {
      const auto it = with_name.find(group.name());
      row.push_back(it == with_name.end() ? "\u2013" : PerNumber(*it->second));
    }
    rows.push_back(std::move(row));
  }
  std::vector<std::string> head = {"recordings or kind of number",
                                   "\u03c7\u00b2 per number, nominal"};
  if (with_model) head.push_back(absl::StrCat("with ", EscapeHtml(named_model)));
  return text + "<details><summary>Group by group</summary>\n" + PageTable(head, rows, {0}) +
         "</details>\n";
}

}  // namespace sightline
