// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/diagnosis/diagnosis_text.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"

namespace sightline {

std::string NameWords(const google::protobuf::RepeatedPtrField<std::string>& names) {
  std::vector<std::string> words;
  for (const std::string& name : names) {
    // What is said in words stays as it is.
    words.push_back(name.find(' ') == std::string::npos ? QuantityName(name) : name);
  }
  return absl::StrJoin(words, ", ");
}

std::optional<double> PerDegree(double chi_squared, int degrees_of_freedom) {
  if (degrees_of_freedom <= 0) return std::nullopt;
  return chi_squared / degrees_of_freedom;
}

std::string PerDegreeText(double chi_squared, int degrees_of_freedom) {
  const std::optional<double> value = PerDegree(chi_squared, degrees_of_freedom);
  return value.has_value() ? Number(*value) : "\u2013";
}

std::string Change(const std::string& before, const std::string& after) {
  return absl::StrCat(before, " \u2192 ", after);
}

std::string GainText(double nats) { return FixedNumber(nats, std::abs(nats) < 10 ? 1 : 0); }

std::string LawHtml(const std::string& law) {
  const std::vector<std::string> given = absl::StrSplit(law, ' ', absl::SkipEmpty());
  std::vector<std::string> words;
  for (size_t i = 0; i < given.size(); ++i) {
    const std::pair<std::string, std::string> power =
        absl::StrSplit(given[i], absl::MaxSplits('^', 1));
    std::string name = QuantityName(power.first);
    double value = 0;
    const size_t digits = i + 1 < given.size() ? given[i + 1].find_last_not_of(",;)") + 1 : 0;
    if (!power.second.empty()) {
      // Powers side by side are multiplied.
      const bool follows_power = !words.empty() && absl::StartsWith(words.back(), "<em>");
      words.push_back(absl::StrCat("<em>", follows_power ? "\u00b7 " : "", EscapeHtml(name)));
      if (power.second != "1") {
        absl::StrAppend(&words.back(), "<sup>",
                        EscapeHtml(absl::StrReplaceAll(power.second, {{"-", "\u2212"}})), "</sup>");
      }
      words.back() += "</em>";
    } else if (power.first.find('_') != std::string::npos && digits > 0 &&
               absl::SimpleAtod(given[i + 1].substr(0, digits), &value)) {
      ++i;
      words.push_back(EscapeHtml(
          absl::StrCat(name, " ", SettingText(power.first, value), given[i].substr(digits))));
    } else {
      words.push_back(EscapeHtml(name));
    }
  }
  return absl::StrJoin(words, " ");
}

std::string ExplanationTitle(const v1::Explanation& explanation) {
  std::vector<std::string> titles;
  for (const v1::FittedEffect& effect : explanation.effects()) {
    titles.push_back(EffectTitle(effect.effect()));
  }
  if (titles.empty()) return EffectTitle(explanation.effect());
  const std::string joined = absl::StrJoin(titles, " + ");
  return explanation.effect() == "unknown" ? absl::StrCat(EffectTitle("unknown"), " (", joined, ")")
                                           : joined;
}

std::string ProbabilityBar(double probability) {
  const double cut = std::isfinite(probability) ? std::clamp(probability, 0.0, 1.0) : 0;
  return absl::StrFormat(
      "<span class=\"nowrap\"><svg class=\"probability\" viewBox=\"0 0 110 10\" "
      "aria-hidden=\"true\"><rect "
      "class=\"rail\" "
      "x=\"0\" y=\"4\" width=\"110\" height=\"2\"/><rect class=\"bar\" x=\"0\" y=\"0\" "
      "width=\"%.1f\" "
      "height=\"10\"/></svg>%s</span>",
      110 * cut, EscapeHtml(ProbabilityText(probability)));
}

}  // namespace sightline
