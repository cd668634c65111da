#include "render_worker/diagnosis/power.h"

#include "render_worker/diagnosis/fit.h"

namespace sightline {

namespace {

// Enough where deviations are far from linear; most fits stop after five.
constexpr int kMostIterations = 40;
constexpr int kRoughIterations = 8;
constexpr int kMostRenewals = 3;

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
  const FitResult refit = FitSet(state_->model, start, FreeParameters(instead), settings, &null);
  return 0.5 * (refit.chi_squared + refit.prior - null.prior);
}

}  // namespace sightline
