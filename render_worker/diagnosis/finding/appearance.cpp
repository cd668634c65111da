// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/appearance.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "render_worker/diagnosis/finding/explanations.h"

namespace sightline {
namespace {

constexpr double kClear_standard_errors = 2;
constexpr size_t kCoefficients = 3;  // that a sentence names

struct ClearCoefficient {
  double standard_errors;  // by which it differs from 0
  std::string text;
};

// The clear coefficients of effect `index`, clearest first.
std::vector<ClearCoefficient> ClearCoefficients(const Hypothesis& hypothesis, size_t index) {
  const ActiveEffect& term = hypothesis.effects[index];
  const Eigen::MatrixXd covariance = CoefficientCovariance(hypothesis, index);
  std::vector<ClearCoefficient> clear;
  for (size_t k = 0; k < term.parameters.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    const double error = std::sqrt(std::max(0.0, covariance(at, at))), value = term.parameters[k];
    if (!(error > 0) || std::abs(value) < kClear_standard_errors * error) continue;
    clear.push_back({std::abs(value) / error,
                     absl::StrFormat("%s = %.3g +- %.1g",
                                     term.effect->description().parameters[k].name, value, error)});
  }
  std::stable_sort(clear.begin(), clear.end(), [](const auto& a, const auto& b) {
    return a.standard_errors > b.standard_errors;
  });
  return clear;
}

std::string TermText(const Hypothesis& hypothesis, size_t index) {
  std::vector<std::string> texts;
  for (const ClearCoefficient& coefficient : ClearCoefficients(hypothesis, index)) {
    if (texts.size() < kCoefficients) texts.push_back(coefficient.text);
  }
  const std::string summary(hypothesis.effects[index].effect->description().summary);
  return texts.empty() ? summary : absl::StrCat(summary, ", with ", absl::StrJoin(texts, ", "));
}

std::string NearestKnown(const ModelComparison& comparison) {
  const Hypothesis& named = comparison.named;
  if (named.effects.empty()) return "";
  std::vector<std::string> names;
  for (const ActiveEffect& active : named.effects) {
    names.emplace_back(active.effect->description().id);
  }
  const double behind = comparison.ranked.front().log_evidence - named.log_evidence;
  return absl::StrFormat(" The nearest known physics, %s, has %.3g nats %s evidence.",
                         absl::StrJoin(names, " with "), std::abs(behind),
                         behind < 0 ? "more" : "less");
}

}  // namespace

std::string AppearanceText(const ModelComparison& comparison, const v1::Diagnosis& diagnosis) {
  const Hypothesis& best = comparison.ranked.front();
  if (!IsFreeForm(best)) return "";
  std::vector<std::string> terms;
  for (size_t e = 0; e < best.effects.size(); ++e) {
    if (IsFreeForm(*best.effects[e].effect)) terms.push_back(TermText(best, e));
  }
  std::string text = absl::StrCat("It looks like this: ", absl::StrJoin(terms, "; and "), ".");
  if (diagnosis.laws_size() > 0 && diagnosis.laws(0).quantity() != "none") {
    absl::StrAppend(&text, " Its size in the recordings: ", diagnosis.laws(0).law(), ".");
  }
  return text + NearestKnown(comparison);
}

}  // namespace sightline
