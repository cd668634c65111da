// SPDX-License-Identifier: Apache-2.0
// Physics that is in no module of render_worker/effects: other laws for what the modules describe.
// A diagnosis that knows the modules only should say "unknown" at the stage of the law.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "render_worker/effects/effect.h"

namespace sightline::bench {

struct VariantLaw {
  const Effect* effect = nullptr;  // id "variant.<name>"; its first parameter is the strength
  // In the words of the recordings format.
  std::vector<std::string_view> regions;
  std::vector<std::string_view> depends_on;
};

// At least one of every stage but geometry.
std::span<const VariantLaw> VariantLaws();

}  // namespace sightline::bench
