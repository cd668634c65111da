// SPDX-License-Identifier: Apache-2.0
// The list of physical effects, as docs/effects.json has it: the renderer can show them and the
// diagnosis can name them. The client does not link the renderer, whose registry that file is
// generated from.
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
  double usual;    // half of all rigs with the effect are believed to deviate by less
  double decades;  // as many decades below `usual` are as likely
};

struct ListedEffect {
  std::string effect;  // stage and name, with a dot between
  std::string stage, summary, source;
  std::vector<ListedParameter> parameters;
};

// In the order in which light meets them.
const std::vector<ListedEffect>& ListedEffects();

// The file itself.
std::string_view EffectListJson();

}  // namespace sightline
