// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/power.h"

#include <algorithm>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

namespace {

// Enough where deviations are far from linear; most fits stop after five.
constexpr int kMostIterations = 40;
constexpr int kRoughIterations = 8;
constexpr int kMostRenewals = 3;
constexpr double kCertainlySmall = 1;  // [nats]

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
  const Entries observed = state_->model.Expect(truth, false).mean;
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
  // Deviations that make up for most of it may lie at the far end of a narrow, bent valley, which
  // is wider for errors that shrink in rounds.
  FitSettings in_rounds;
  in_rounds.observed = &observed;
  const FitResult found = FitSet(state_->model, start, FreeParameters(instead), in_rounds, nullptr);
  return std::min(straight, left(found.parameters));
}

}  // namespace sightline
