// SPDX-License-Identifier: Apache-2.0
// The evidence of a model by Laplace's approximation, split into its terms.
#pragma once

#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Logarithm of the evidence p(y | M) p(M) of a model with residuals r, data covariance S,
// standardised parameters z and the information matrix H of all parameters with their priors, up to
// a constant of the data (MacKay, Information Theory, Inference, and Learning Algorithms, chapter
// 28):
//   log E = -1/2 r' S^-1 r - 1/2 log|S| - 1/2 log|H| + log p(z) + log p(M)
// All terms in nats.
struct Evidence {
  double fit = 0;              // -1/2 r' S^-1 r
  double covariance = 0;       // -1/2 log|S|
  double curvature = 0;        // -1/2 log|H|
  double parameter_prior = 0;  // log p(z); the factor (2 pi)^(1/2) of each parameter cancels H's
  double model_prior = 0;      // log p(M)

  // The logarithm without the prior of the model: the information of data and parameters.
  double LogMarginalLikelihood() const { return fit + covariance + curvature + parameter_prior; }
  double Log() const { return LogMarginalLikelihood() + model_prior; }
};

// Differences of the terms of two models of the same data, and sums of terms.
Evidence operator-(const Evidence& a, const Evidence& b);
Evidence operator+(const Evidence& a, const Evidence& b);

// All five terms, for diagnosis_full.json.
v1::Evidence EvidenceToProto(const Evidence& evidence);

}  // namespace sightline
