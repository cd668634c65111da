// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/spelling/nearest_name.h"
#include "core/text/number_text.h"
#include "render_worker/effects/discrepancy/free_form.h"
#include "render_worker/effects/effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

const std::vector<const Effect*>& Registry() {
#define X(effect) &effect(),
  static const std::vector<const Effect*> effects = {SIGHTLINE_EFFECTS(X)};
#undef X
  return effects;
}

// Limits the length of an external name that is examined and quoted.
std::string Head(std::string_view name) { return std::string(name.substr(0, 100)); }

}  // namespace

std::span<const Effect* const> AllEffects() { return Registry(); }

const Effect* FindEffect(std::string_view id) {
  for (const Effect* effect : Registry()) {
    if (effect->description().id == id) return effect;
  }
  return nullptr;
}

absl::StatusOr<ActiveEffect> MakeActiveEffect(std::string_view id,
                                              const std::vector<NamedValue>& parameters) {
  const Effect* effect = FindEffect(id);
  if (effect == nullptr) effect = FindFreeFormTerm(id);
  if (effect == nullptr) {
    std::vector<std::string> ids;
    for (const Effect* known : Registry()) ids.emplace_back(known->description().id);
    return absl::InvalidArgumentError(absl::StrCat("there is no effect \"", Head(id),
                                                   "\"; the nearest known name is \"",
                                                   NearestName(Head(id), ids), "\""));
  }
  const EffectDescription& description = effect->description();
  ActiveEffect active{effect, {}};
  std::vector<std::string> names;
  for (const EffectParameter& parameter : description.parameters) {
    active.parameters.push_back(parameter.null_value);
    names.emplace_back(parameter.name);
  }
  std::vector<bool> given(names.size(), false);
  for (const NamedValue& value : parameters) {
    const auto found = std::find(names.begin(), names.end(), value.name);
    if (found == names.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("effect ", std::string(id), " has no parameter \"", Head(value.name),
                       "\"; the nearest known name is \"", NearestName(value.name, names), "\""));
    }
    const size_t index = static_cast<size_t>(found - names.begin());
    const EffectParameter& parameter = description.parameters[index];
    if (given[index]) {
      return absl::InvalidArgumentError(
          absl::StrCat("effect ", std::string(id), ": parameter ", value.name, " is given twice"));
    }
    given[index] = true;
    if (!(value.value >= parameter.lower && value.value <= parameter.upper)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "effect ", std::string(id), ": ", value.name, " is ", NumberText(value.value),
          ", must be in [", NumberText(parameter.lower), ", ", NumberText(parameter.upper), "]"));
    }
    active.parameters[index] = value.value;
  }
  return active;
}

absl::Status OrderEffects(std::vector<ActiveEffect>* effects) {
  std::vector<ActiveEffect> ordered;
  for (const std::span<const Effect* const> known : {AllEffects(), FreeFormTerms()}) {
    for (const Effect* effect : known) {
      const size_t before = ordered.size();
      for (ActiveEffect& active : *effects) {
        if (active.effect == effect) ordered.push_back(std::move(active));
      }
      if (ordered.size() > before + 1) {
        return absl::InvalidArgumentError(
            absl::StrCat("effect ", std::string(effect->description().id), " is given twice"));
      }
    }
  }
  *effects = std::move(ordered);
  return absl::OkStatus();
}

}  // namespace sightline
