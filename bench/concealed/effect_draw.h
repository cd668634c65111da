// SPDX-License-Identifier: Apache-2.0
// Effects drawn at random, with a strength that makes them as visible as wanted.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/random/counter_random.h"
#include "core/sensor/sensor.h"
#include "render_worker/effects/effect.h"

namespace sightline::bench {

// Expected gain in log-likelihood over the refitted null model (NullInformation::ExpectedGain).
using ExpectedGain = std::function<double(const std::vector<ActiveEffect>&)>;

// An effect whose shape is drawn and whose strength is to be found: parameters as a function of a
// scale; 0 is the null value, strictly stronger as it grows.
struct EffectFamily {
  const Effect* effect = nullptr;
  std::vector<double> shape;      // parameters at scale 0
  std::vector<double> direction;  // change per unit of scale, 0 for mere shapes
  // The first parameter runs from its null value to its lower bound in equal ratios, scale 0 to 1.
  bool geometric = false;
  bool whole_numbers = false;  // the first parameter
  double largest_scale = 0;    // a parameter is at a bound

  ActiveEffect At(double scale) const;
};

// Effects of the recordings format's vocabulary, in its order.
std::vector<const Effect*> VocabularyEffects();
// True: the effect shows in scatter or fixed patterns; where the expected gain is 0, the statistics
// it is computed from do not see it, which does not mean that no recording could.
bool ShowsBeyondTheMean(const Effect& effect);

// Draws what the strength leaves open: signs, ratios of several strengths, parameters that merely
// shape (log-uniform or uniform within a plausible range about their typical values).
EffectFamily DrawFamily(const Effect& effect, const Sensor& camera, CounterRandom& random);

struct ScaledEffect {
  ActiveEffect effect;
  double scale = 0;
  double gain = 0;         // expected
  bool gain_known = true;  // false: see ShowsBeyondTheMean; gain is 0
  bool reached = false;    // within 5 % of the target, or as near as whole numbers allow
};
// Bisection on the scale for gain(effect) = target. Where even the largest scale gains less, that
// is the answer.
ScaledEffect ScaleToGain(const EffectFamily& family, const ExpectedGain& gain, double target);

}  // namespace sightline::bench
