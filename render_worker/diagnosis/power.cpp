#include "render_worker/diagnosis/power.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "render_worker/diagnosis/fit.h"
#include "render_worker/diagnosis/linear_fit.h"

namespace sightline {

namespace {

constexpr int kMostSteps = 12;
constexpr double kShortestStep = 0.01;
constexpr double kConverged = 0.05;  // [nats]

}  // namespace

struct NullInformation::State {
  State(const RecordedSet& set, const SetModelSettings& settings, const SetParameters& parameters)
      : model(set, settings), fit(LineariseSet(model, parameters)), linear(fit) {}
  SetModel model;
  FitResult fit;
  LinearFit linear;
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
  // Gauss and Newton: a shift of the line or a factor of the noise is far from linear, and what a
  // deviation makes as well must not count.
  const double prior = state.fit.standardised.squaredNorm();
  Eigen::MatrixXd jacobian = state.linear.jacobian();
  Eigen::VectorXd standardised = state.fit.standardised;
  Eigen::VectorXd rest = change;
  double least = 0.5 * change.squaredNorm();
  double length = 1;  // of the step; shorter where the model is bent too much for the whole
  for (int step = 0; step < kMostSteps && length > kShortestStep; ++step) {
    Eigen::MatrixXd information = Eigen::MatrixXd::Identity(jacobian.cols(), jacobian.cols());
    information.noalias() += jacobian.transpose() * jacobian;
    const Eigen::VectorXd moved =
        standardised + length * information.llt().solve(jacobian.transpose() * rest - standardised);
    const SetParameters refitted = AtStandardised(state.model, state.fit.parameters, moved);
    const Eigen::VectorXd left =
        change - state.linear.Change(state.model.Expect(refitted, false).mean);
    const double here = 0.5 * (left.squaredNorm() + moved.squaredNorm() - prior);
    const Eigen::VectorXd moves = moved - standardised;
    if (!(moves.squaredNorm() > 0)) break;
    UpdateDerivatives(moves, rest - left, jacobian);
    if (!(here < least)) {
      length *= 0.3;
      continue;
    }
    const double improved = least - here;
    standardised = moved;
    rest = left;
    least = here;
    if (length == 1 && improved < kConverged + 0.01 * std::abs(least)) break;
    length = std::min(1.0, 2 * length);
  }
  return least;
}

}  // namespace sightline
