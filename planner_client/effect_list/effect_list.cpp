// SPDX-License-Identifier: Apache-2.0
#include "planner_client/effect_list/effect_list.h"

#include <nlohmann/json.hpp>

#include "core/embedded_file/embedded_file.h"

SIGHTLINE_EMBED(sightline_effect_list, SIGHTLINE_EFFECT_LIST)

namespace sightline {

std::string_view EffectListJson() { return SIGHTLINE_EMBEDDED(sightline_effect_list); }

const std::vector<ListedEffect>& ListedEffects() {
  static const std::vector<ListedEffect> effects = [] {
    std::vector<ListedEffect> list;
    // A test reads it, so that it cannot be wrong here.
    const nlohmann::json file = nlohmann::json::parse(EffectListJson());
    for (const nlohmann::json& entry : file["effects"]) {
      ListedEffect& effect = list.emplace_back();
      effect.effect = entry["effect"].get<std::string>();
      effect.stage = entry["stage"].get<std::string>();
      effect.summary = entry["summary"].get<std::string>();
      effect.source = entry["source"].get<std::string>();
      for (const nlohmann::json& parameter : entry["parameters"]) {
        const auto number = [&](const char* name) { return parameter[name].get<double>(); };
        effect.parameters.push_back({parameter["name"].get<std::string>(),
                                     parameter["unit"].get<std::string>(), number("without"),
                                     number("lower"), number("upper"), number("usual"),
                                     number("decades")});
      }
    }
    return list;
  }();
  return effects;
}

}  // namespace sightline
