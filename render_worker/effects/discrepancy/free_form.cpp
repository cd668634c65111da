// SPDX-License-Identifier: Apache-2.0
#include "render_worker/effects/discrepancy/free_form.h"

#include <vector>

#include "render_worker/effects/discrepancy/free_form_effect.h"

namespace sightline {
namespace {

const std::vector<const FreeFormEffect*>& Terms() {
  static const std::vector<const FreeFormEffect*> terms = [] {
    std::vector<const FreeFormEffect*> all;
    for (const std::vector<const FreeFormEffect*>& of_stage :
         {IlluminationTerms(), SurfaceTerms(), OpticsTerms(), GeometryTerms(), SensorTerms(),
          ReadoutTerms(), TimeTerms()}) {
      all.insert(all.end(), of_stage.begin(), of_stage.end());
    }
    return all;
  }();
  return terms;
}

}  // namespace

std::span<const Effect* const> FreeFormTerms() {
  static const std::vector<const Effect*> effects(Terms().begin(), Terms().end());
  return effects;
}

const Effect* FindFreeFormTerm(std::string_view id) {
  for (const Effect* term : FreeFormTerms()) {
    if (term->description().id == id) return term;
  }
  return nullptr;
}

}  // namespace sightline
