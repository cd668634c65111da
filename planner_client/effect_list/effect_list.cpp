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
    for (const nlohmann::json& entry : nlohmann::json::parse(EffectListJson())["effects"]) {
      ListedEffect& effect = list.emplace_back();
      effect.effect = entry["effect"];
      effect.stage = entry["stage"];
      effect.summary = entry["summary"];
      effect.source = entry["source"];
      for (const nlohmann::json& parameter : entry["parameters"]) {
        effect.parameters.push_back({parameter["name"], parameter["unit"], parameter["without"],
                                     parameter["lower"], parameter["upper"], parameter["usual"],
                                     parameter["decades"]});
      }
    }
    return list;
  }();
  return effects;
}

}  // namespace sightline
