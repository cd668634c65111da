// SPDX-License-Identifier: Apache-2.0
// Maximum and integral of a marginal likelihood over one or two parameters of a random effect: the
// strength s and perhaps a shape (frequency, correlation length or time, exponent).
//
// The prior is Cauchy in the standardised parameters: half Cauchy in s over its scale, Cauchy in
// the standardised shape. A coarse grid, logarithmic in s, finds the peak; pattern search climbs to
// its top; the evidence is integrated over the grids and by Laplace's approximation.
#pragma once

#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "render_worker/effects/effect.h"

namespace sightline {

// Logarithm of the marginal likelihood over that without the random effect [nats], at parameters in
// the order of the description.
using LogLikelihoodRatio = std::function<double(const std::vector<double>& parameters)>;

struct EvidencePeak {
  std::vector<double> parameters;       // of largest likelihood
  std::vector<double> standard_errors;  // of them
  double log_evidence = 0;              // logarithm of the likelihood averaged over the prior
  double gain = -1e300;                 // largest log likelihood ratio
};

struct EvidenceSearchSettings {
  // Larger values of the second parameter are not searched.
  double largest_shape = std::numeric_limits<double>::infinity();
  // The likelihood has many peaks along the shape: search a finer grid near the best strength.
  bool many_shapes = false;
};

// `description`: one or two parameters; the first is the strength, with null value 0 and an upper
// bound > 0.
EvidencePeak SearchEvidence(std::span<const EffectParameter> description,
                            const LogLikelihoodRatio& gain, const EvidenceSearchSettings& settings);

}  // namespace sightline
