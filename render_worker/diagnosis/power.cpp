#include "render_worker/diagnosis/power.h"

#include <utility>

#include "render_worker/diagnosis/fit.h"
#include "render_worker/diagnosis/linear_fit.h"

namespace sightline {

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
  SetParameters parameters = state_->fit.parameters;
  parameters.effects = effects;
  const Eigen::VectorXd change =
      state_->linear.Change(state_->model.Expect(parameters, false).mean);
  return 0.5 * state_->linear.Inner(change, change);
}

}  // namespace sightline
