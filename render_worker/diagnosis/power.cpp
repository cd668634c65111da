#include "render_worker/diagnosis/power.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "render_worker/diagnosis/fit.h"
#include "render_worker/diagnosis/linear_fit.h"

namespace sightline {

namespace {

constexpr int kMostSteps = 5;

}  // namespace

struct NullInformation::State {
  State(const RecordedSet& set, const SetModelSettings& settings, const SetParameters& parameters)
      : model(set, settings),
        fit(LineariseSet(model, parameters)),
        linear(fit),
        information(linear.information()) {}
  SetModel model;
  FitResult fit;
  LinearFit linear;
  Eigen::LLT<Eigen::MatrixXd> information;
};

NullInformation::NullInformation(const RecordedSet& set, const SetModelSettings& settings,
                                 const SetParameters& parameters)
    : state_(std::make_unique<State>(set, settings, parameters)) {}

NullInformation::~NullInformation() = default;

double NullInformation::ExpectedGain(const std::vector<ActiveEffect>& effects) const {
  const State& state = *state_;
  SetParameters parameters = state.fit.parameters;
  parameters.effects = effects;
  const Eigen::VectorXd change = state.linear.Change(state.model.Expect(parameters, false).mean);
  // Gauss and Newton with the derivatives at hand: a shift of the line is far from linear, and what
  // a deviation makes as well must not count.
  const double prior = state.fit.standardised.squaredNorm();
  Eigen::VectorXd standardised = state.fit.standardised;
  Eigen::VectorXd rest = change;
  double least = 0.5 * change.squaredNorm();
  for (int step = 0; step < kMostSteps; ++step) {
    standardised += state.linear.Absorb(rest) - state.information.solve(standardised);
    const SetParameters refitted = AtStandardised(state.model, state.fit.parameters, standardised);
    rest = change - state.linear.Change(state.model.Expect(refitted, false).mean);
    const double here = 0.5 * (rest.squaredNorm() + standardised.squaredNorm() - prior);
    if (here > 0.98 * least) return std::min(here, least);
    least = here;
  }
  return least;
}

}  // namespace sightline
