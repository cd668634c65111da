// SPDX-License-Identifier: Apache-2.0
// The list of physical effects in docs/effects.json, which the renderer can show and the
// diagnosis can identify. The client does not link the renderer, whose registry generates that
// file.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sightline {

struct ListedParameter {
  std::string name;
  std::string unit;  // "1" of plain numbers
  double without;    // value without the effect
  double lower, upper;
  double usual;    // median deviation over all rigs with the effect (prior belief)
  double decades;  // as many decades below `usual` are as likely
};

struct ListedEffect {
  std::string effect;  // stage and name, with a dot between
  std::string stage, summary, source;
  std::vector<ListedParameter> parameters;
};

// Effects in the order in which light meets them.
const std::vector<ListedEffect>& ListedEffects();

// Text of the file.
std::string_view EffectListJson();

}  // namespace sightline
