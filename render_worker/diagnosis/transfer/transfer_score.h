// SPDX-License-Identifier: Apache-2.0
// Which candidate functions of a discrepancy predict settings that they were not fitted to?
//
// The discrepancy is delta = Phi w with w ~ N(0, tau^2 I), in addition to the known parameters z of
// a fit. Both are estimated from the components used in a split; tau by the evidence of these. The
// score is the logarithm of the predictive density of the held-out components given those used,
// speckle that both share included. Physics that repeats over a setting is predicted by functions
// of its own coordinates and not by others (BayesWave compares coherent with independent models
// over detectors in this way, Cornish and Littenberg, Class. Quantum Grav. 32 (2015) 135012).
#pragma once

#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/transfer/setting_split.h"

namespace sightline {

// Changes of the expectation by unit coefficients [units of the statistics], one of every column of
// Phi.
using DiscrepancyColumns = std::vector<BlockVectors>;

// Sum over groups of components, which count as independent of each other: a plate position, a dark
// frame, or what is computed from several positions.
struct TransferScore {
  std::vector<double> of_group;  // [nats]
  double Total() const;
};

// Score of every candidate, a mean over the splits; each component counts where it is held out.
// `base`: the fit that the discrepancy is added to. A candidate may have no column: the base alone.
std::vector<TransferScore> ScoreTransfer(const SetModel& model, const FitResult& base,
                                         const std::vector<SettingSplit>& splits,
                                         const std::vector<DiscrepancyColumns>& candidates);

// Total of `a` over that of `b`, and its standard error from the variance over groups.
struct ScoreDifference {
  double nats = 0, standard_error = 0;
};
ScoreDifference Difference(const TransferScore& a, const TransferScore& b);

}  // namespace sightline
