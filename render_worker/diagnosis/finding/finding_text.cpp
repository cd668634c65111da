// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/finding_text.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "render_worker/evidence/answer_text.h"

namespace sightline {

namespace {

std::string Percent(double probability) {
  return absl::StrFormat("%.0f %%", 100 * std::min(0.99, probability));
}

std::string EffectsInWords(const google::protobuf::RepeatedPtrField<v1::FittedEffect>& effects) {
  std::vector<std::string> parts;
  for (const v1::FittedEffect& effect : effects) {
    std::string part = effect.effect();
    if (effect.parameters_size() > 0) {
      const v1::FittedParameter& parameter = effect.parameters(0);
      absl::StrAppend(&part, " (", parameter.name(), " = ",
                      absl::StrFormat("%.3g", parameter.value()));
      if (parameter.has_standard_error()) {
        absl::StrAppend(&part, absl::StrFormat(" +- %.1g", parameter.standard_error()));
      }
      absl::StrAppend(&part, ")");
    }
    parts.push_back(std::move(part));
  }
  return absl::StrJoin(parts, " and ");
}

// The line on the remainder, with the line break before it, or nothing.
std::string RemainderLine(const v1::Diagnosis& diagnosis) {
  const std::string text = RemainderText(diagnosis);
  if (text.empty()) return "";
  const std::string& stage = diagnosis.remainder().stage();
  return absl::StrCat("\n", text,
                      stage.empty() ? ""
                                    : absl::StrCat(" A model-discrepancy term at the stage \"",
                                                   stage, "\" describes it best."));
}

std::string AnswerSentence(const Hypothesis& best, const v1::Diagnosis& diagnosis) {
  const v1::Explanation& first = diagnosis.ranked(0);
  const auto chi = [&](double value) { return absl::StrFormat("%.3g", value); };
  const v1::HeldOutImprovement& held_out = diagnosis.held_out_improvement();
  if (first.effect() == "none") {
    return absl::StrCat(NullIsRejectedAnswer(diagnosis)
                            ? "None of the known effects is found ("
                            : "Nothing is missing beyond the stated uncertainties (",
                        Percent(first.probability()), "); chi squared per number is ",
                        chi(held_out.null()), " on recordings not fitted.");
  }
  std::string what;
  if (first.effect() == "unknown") {
    what = absl::StrCat("Something that no known effect describes is missing at the stage \"",
                        first.stage(), "\"");
    if (best.effects.size() > 1) {
      absl::StrAppend(&what, ", near to ",
                      std::string(best.effects.front().effect->description().id));
    } else if (diagnosis.part_of_it_size() > 0) {
      absl::StrAppend(&what, "; part of it is ", EffectsInWords(diagnosis.part_of_it()));
    }
  } else {
    what = absl::StrCat("The recordings show ", EffectsInWords(first.effects()));
    if (diagnosis.same_class_size() > 0) {
      absl::StrAppend(&what, " or what changes them alike (",
                      absl::StrJoin(diagnosis.same_class(), ", "), ")");
    }
  }
  return absl::StrCat(what, ": probability ", Percent(first.probability()),
                      "; chi squared per number on recordings not fitted falls from ",
                      chi(held_out.null()), " to ", chi(held_out.with_effect()), ".");
}

}  // namespace

std::string FindingText(const Hypothesis& best, const v1::Diagnosis& diagnosis) {
  return AnswerSentence(best, diagnosis) + RemainderLine(diagnosis);
}

}  // namespace sightline
