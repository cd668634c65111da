// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/power.h"

#include <algorithm>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

namespace {

// Iterations of a refit, and of a rough one. Chosen: most refits converge after five; 40 suffice
// where the model is far from linear in the deviations.
constexpr int kMostIterations = 40;
constexpr int kRoughIterations = 8;
// Renewals of the derivatives in a refit. Chosen: they bound the time of a refit.
constexpr int kMostRenewals = 3;
// Gain below which no better refit is searched [nats]. Chosen: no decision depends on less.
constexpr double kCertainlySmall = 1;

}  // namespace

struct NullInformation::State {
  State(const RecordedSet& set, const SetModelSettings& settings, const SetParameters& parameters)
      : model(set, settings), fit(LineariseSet(model, parameters)) {}
  SetModel model;
  FitResult fit;
};

NullInformation::NullInformation(const RecordedSet& set, const SetModelSettings& settings,
                                 const SetParameters& parameters)
    : state_(std::make_unique<State>(set, settings, parameters)) {}

NullInformation::~NullInformation() = default;

double NullInformation::ExpectedGain(const std::vector<ActiveEffect>& effects, bool roughly) const {
  return Left(effects, {}, roughly ? 0 : kMostRenewals);
}

double NullInformation::GainLeft(const std::vector<ActiveEffect>& effects,
                                 const std::vector<ActiveEffect>& instead) const {
  return Left(effects, instead, kMostRenewals);
}

double NullInformation::Left(const std::vector<ActiveEffect>& effects,
                             const std::vector<ActiveEffect>& instead, int most_renewals) const {
  const FitResult& null = state_->fit;
  SetParameters truth = null.parameters, start = null.parameters;
  truth.effects = effects;
  start.effects = instead;
  const BlockVectors observed = state_->model.Expect(truth, false).mean;
  FitSettings settings;
  settings.rounds.clear();
  settings.renew_jacobian = false;
  settings.max_iterations = most_renewals > 0 ? kMostIterations : kRoughIterations;
  settings.most_renewals = most_renewals;
  settings.observed = &observed;
  const auto left = [&](const SetParameters& from) {
    const FitResult refit = FitSet(state_->model, from, FreeParameters(instead), settings, &null);
    return 0.5 * (refit.chi_squared + refit.prior - null.prior);
  };
  const double straight = left(start);
  if (most_renewals == 0 || straight < kCertainlySmall) return straight;
  // Deviations that imitate the effects may lie at the far end of a narrow, curved valley. Rounds
  // with inflated covariances widen it, so a refit with rounds gives a second start.
  FitSettings in_rounds;
  in_rounds.observed = &observed;
  const FitResult found = FitSet(state_->model, start, FreeParameters(instead), in_rounds, nullptr);
  return std::min(straight, left(found.parameters));
}

}  // namespace sightline
