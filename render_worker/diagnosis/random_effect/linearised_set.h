// SPDX-License-Identifier: Apache-2.0
// A set's model linearised about a fit and a realisation: the linear mixed model of what the
// amplitudes of a random effect change.
#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/diagnosis/random_effect/law/random_effect.h"
#include "render_worker/diagnosis/random_effect/linear_mixed_model.h"
#include "render_worker/diagnosis/random_effect/lit_recordings.h"
#include "render_worker/diagnosis/random_effect/realisation.h"

namespace sightline {

// The fit about which a set is linearised, and what all linearisations about it have in common.
// `model` and `fit` must outlive it.
struct LinearisationBasis {
  const SetModel& model;
  const FitResult& fit;                   // gives nuisance parameters, Jacobian and whitening
  Realisation fitted_at;                  // at which `fit` computed its covariances
  std::vector<Eigen::MatrixXd> jacobian;  // of `fit`; columns of parameters at a bound are 0
  std::vector<int> offset;    // index of every block's first component; their total number last
  std::vector<int> position;  // plate position of every block; -1: none or several
  std::vector<int> segment;   // segment of the line that a block shows; -1: all
  LitRecordings lit;
  // Twice the negative log marginal likelihood of the model compared with (LogMarginalLikelihood).
  double reference = 0;

  int components() const { return offset.back(); }
  int size(int block) const { return offset[block + 1] - offset[block]; }
  int recordings() const { return lit.count(); }  // with laser light
};

// `fit`: the model fitted at the realisation `fitted_at`. `null`: the fit without the random
// effect, with which it is compared.
LinearisationBasis MakeBasis(const SetModel& model, const FitResult& fit,
                             const Realisation& fitted_at, const FitResult& null);

struct LinearisedSet {
  // `residual` is extrapolated to amplitudes and nuisance parameters 0. `offset_change` has a
  // column per recording with laser light, per unit of RandomEffect::VarianceWithin.
  LinearMixedModel model;
  ProjectedModel projected;
  Eigen::VectorXd amplitudes;       // at the linearisation point
  Eigen::VectorXd variance_within;  // the same; empty for kLight
  // Covariances of the blocks for which `fit` has another one.
  std::map<int, Eigen::MatrixXd> covariance;
};

// By finite differences about the realisation `at`.
LinearisedSet Linearise(const LinearisationBasis& basis, Amplitude amplitude,
                        const Realisation& at);

// Covariance of a block, from the inverse of its whitening.
Eigen::MatrixXd CovarianceOfBlock(const LinearisationBasis& basis, int block);

// Expectation of a model with a realisation. `middle_only`: as SetModel::Expect.
SetModel::Expectation ExpectAt(const SetModel& model, const SetParameters& parameters,
                               const Realisation& realisation, bool with_covariance,
                               bool middle_only = false);

}  // namespace sightline
