// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/answer_json.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

// `fitted` may be null: "none", "unknown".
Json Entry(const std::string& effect, const std::string& stage, double probability,
           const v1::FittedEffect* fitted) {
  Json entry = {{"effect", effect},
                {"stage", stage},
                {"probability", probability},
                {"parameters", Json::object()},
                {"standard_errors", Json::object()},
                {"regions", Json::array()},
                {"depends_on", Json::array()}};
  if (fitted == nullptr) return entry;
  for (const v1::FittedParameter& parameter : fitted->parameters()) {
    if (!std::isfinite(parameter.value())) continue;
    entry["parameters"][parameter.name()] = parameter.value();
    if (parameter.has_standard_error() && std::isfinite(parameter.standard_error())) {
      entry["standard_errors"][parameter.name()] = parameter.standard_error();
    }
  }
  for (const std::string& region : fitted->regions()) entry["regions"].push_back(region);
  for (const std::string& quantity : fitted->depends_on()) entry["depends_on"].push_back(quantity);
  return entry;
}

Json Ranked(const v1::Diagnosis& diagnosis) {
  std::vector<Json> entries;
  for (const v1::Explanation& explanation : diagnosis.ranked()) {
    const auto same = std::find_if(entries.begin(), entries.end(), [&](const Json& entry) {
      return entry["effect"] == explanation.effect();
    });
    if (same != entries.end()) {
      (*same)["probability"] = (*same)["probability"].get<double>() + explanation.probability();
      continue;
    }
    entries.push_back(Entry(explanation.effect(), explanation.stage(), explanation.probability(),
                            explanation.effects().empty() ? nullptr : &explanation.effects(0)));
  }
  // The first entry stays first: it is the finding.
  if (!entries.empty()) {
    std::stable_sort(entries.begin() + 1, entries.end(), [](const Json& a, const Json& b) {
      return a["probability"].get<double>() > b["probability"].get<double>();
    });
  }
  return entries;
}

Json AlsoPresent(const v1::Diagnosis& diagnosis) {
  Json entries = Json::array();
  if (diagnosis.ranked().empty()) return entries;
  const auto& effects = diagnosis.ranked(0).effects();
  for (int i = 1; i < effects.size(); ++i) {
    double probability = 0;
    for (const v1::Explanation& explanation : diagnosis.ranked()) {
      const bool part = std::any_of(
          explanation.effects().begin(), explanation.effects().end(),
          [&](const v1::FittedEffect& effect) { return effect.effect() == effects[i].effect(); });
      if (part) probability += explanation.probability();
    }
    entries.push_back(Entry(effects[i].effect(), effects[i].stage(), probability, &effects[i]));
  }
  return entries;
}

Json RemainderJson(const v1::Remainder& remainder) {
  Json json = {{"stage", remainder.stage()}};
  if (std::isfinite(remainder.share())) json["share"] = remainder.share();
  if (std::isfinite(remainder.probability())) json["probability"] = remainder.probability();
  json["group"] = remainder.group();
  return json;
}

Json CheckJson(const v1::PredictiveCheck& check) {
  Json json = {{"p_value", check.p_value()},
               {"log_score_gain", check.log_score_gain()},
               {"groups", Json::array()}};
  for (const v1::PredictedGroup& group : check.groups()) {
    json["groups"].push_back({{"name", group.name()},
                              {"chi_squared", group.chi_squared()},
                              {"degrees_of_freedom", group.degrees_of_freedom()},
                              {"p_value", group.p_value()}});
  }
  return json;
}

}  // namespace

std::string AnswerJson(const v1::Diagnosis& diagnosis) {
  Json answer = {{"set", diagnosis.set()},
                 {"verdict", diagnosis.verdict()},
                 {"ranked", Ranked(diagnosis)},
                 {"also_present", AlsoPresent(diagnosis)}};
  for (const std::string& stage : diagnosis.located_stages()) {
    answer["located_stages"].push_back(stage);
  }
  if (diagnosis.has_remainder()) answer["remainder"] = RemainderJson(diagnosis.remainder());
  if (diagnosis.has_held_out_improvement()) {
    const v1::HeldOutImprovement& held_out = diagnosis.held_out_improvement();
    answer["held_out_improvement"] = {{"measure", held_out.measure()},
                                      {"null", held_out.null()},
                                      {"with_effect", held_out.with_effect()},
                                      {"recordings", Json::array()}};
    for (const int recording : held_out.recordings()) {
      answer["held_out_improvement"]["recordings"].push_back(recording);
    }
  }
  if (diagnosis.has_named_check()) {
    answer["predictive_check"] = {{"null", CheckJson(diagnosis.null_check())},
                                  {"named", CheckJson(diagnosis.named_check())}};
  }
  return answer.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace sightline
