// SPDX-License-Identifier: Apache-2.0
// Screening as the stages use it: of all effects about a fit, and of effects that are added to a
// hypothesis.
#pragma once

#include <vector>

#include "render_worker/diagnosis/selection/context.h"

namespace sightline {

struct ScreeningResult {
  std::vector<ScreenedEffect> effects;
  bool stopped = false;  // Context::proceed returned false; `effects` are those until then
};

// Stage 1: all effects and terms that change the expectation, about the null model.
ScreeningResult ScreenExpected(const Context& context, const Screening& about_null);

// The effects of the vocabulary that change the expectation, about the base of `screening`.
// `fraction`: of the comparison that is done, reported.
ScreeningResult ScreenNamed(const Context& context, const Screening& screening, double fraction);

// Effects with shapes or discrete values, about the fit of `base`, which does not have them.
// Screened about the null model, the shape of such an effect is that of the difference that `base`
// explains, not of what it leaves.
ScreeningResult ScreenShapes(const Context& context, const Hypothesis& base);

// An effect added to a hypothesis, and its gain by the linearised model [nats]. Valid as long as
// `base`.
struct JointEffect {
  const Hypothesis* base;
  ActiveEffect added;
  double gain;
};

// Every effect of the vocabulary that `base` does not have. `about_base`: effects screened about
// `base`, which count instead of those screened about the null model.
std::vector<JointEffect> JointGains(const Context& context, const Hypothesis& base,
                                    const std::vector<ScreenedEffect>& about_base);

// Largest sum of the base's evidence and the gain first.
std::vector<JointEffect> SortedByTotal(std::vector<JointEffect> joints);

}  // namespace sightline
