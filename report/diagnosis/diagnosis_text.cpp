// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/diagnosis_text.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "report/page/number_text.h"

namespace sightline {

std::string NameWords(const google::protobuf::RepeatedPtrField<std::string>& names) {
  std::vector<std::string> words;
  for (const std::string& name : names) {
    // Names that are words stay unchanged.
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

namespace {

// An integer exponent in superscript digits, others as "^0.52".
std::string RaisedText(const std::string& exponent) {
  int whole = 0;
  if (!absl::SimpleAtoi(exponent, &whole)) {
    return absl::StrCat("^", absl::StrReplaceAll(exponent, {{"-", "\u2212"}}));
  }
  constexpr const char* kDigits[] = {"\u2070", "\u00b9", "\u00b2", "\u00b3", "\u2074",
                                     "\u2075", "\u2076", "\u2077", "\u2078", "\u2079"};
  std::string raised;
  for (const char c : absl::StrCat(whole)) raised += c == '-' ? "\u207b" : kDigits[c - '0'];
  return raised;
}

}  // namespace

std::string LawText(const std::string& law) {
  const std::vector<std::string> given = absl::StrSplit(law, ' ', absl::SkipEmpty());
  std::vector<std::string> words;
  bool follows_power = false;
  for (size_t i = 0; i < given.size(); ++i) {
    const std::pair<std::string, std::string> power =
        absl::StrSplit(given[i], absl::MaxSplits('^', 1));
    const std::string name = QuantityName(power.first);
    double value = 0;
    const size_t digits = i + 1 < given.size() ? given[i + 1].find_last_not_of(",;)") + 1 : 0;
    if (!power.second.empty()) {
      // Powers side by side are multiplied.
      words.push_back(absl::StrCat(follows_power ? "\u00b7 " : "", name,
                                   power.second == "1" ? "" : RaisedText(power.second)));
      follows_power = true;
      continue;
    }
    follows_power = false;
    if (power.first.find('_') != std::string::npos && digits > 0 &&
        absl::SimpleAtod(given[i + 1].substr(0, digits), &value)) {
      ++i;
      words.push_back(
          absl::StrCat(name, " ", SettingText(power.first, value), given[i].substr(digits)));
    } else {
      words.push_back(name);
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

}  // namespace sightline
