// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/finite_differences.h"

#include <algorithm>
#include <cmath>

#include "render_worker/plate/plate_scene.h"

namespace sightline {

namespace {

// Change of the whitened expectation that a step aims at [standard deviations]. Chosen: the size of
// the differences that the data resolve.
constexpr double kChange = 1;
// Longest step, standardised. Chosen: within a quarter of the prior's standard deviation the model
// is close to linear.
constexpr double kLargestStep = 0.25;
// Fraction of kChange below which the expectation counts as unchanged. Chosen: clearly below the
// aim, so that only plateaus (rounded numbers, full pixels) are meant.
constexpr double kNoChange = 0.1;
// Growth of a step on such a plateau. Chosen: one growth leads from kFirstStep to kLargestStep.
constexpr double kStepGrowth = 5;
// Bound on repeated differences of one column. Chosen: it bounds the time of a Jacobian.
constexpr int kMostAttempts = 4;
// Squared column norm below which a column counts as this: it keeps the step length finite.
constexpr double kLeastSquare = 1e-12;
// Standardised distance beyond which a parameter counts as moved by its bound; above rounding.
constexpr double kAtBound = 1e-9;

// Deviations that change nothing but the amount of laser light, by their names in the format. Those
// of the surface do so only if all recordings have the same directions of light and view.
bool IsAmountOfLight(std::string_view name, bool same_directions) {
  if (name == "diffuse_albedo_relative" || name == "specular_f0_relative" ||
      name == "ggx_alpha_relative") {
    return same_directions;
  }
  return name == "power_relative" || name == "transmission_relative" ||
         name == "quantum_efficiency_relative";
}

}  // namespace

FiniteDifferences::FiniteDifferences(const FitProblem& problem)
    : problem_(problem), steps_(Eigen::VectorXd::Constant(problem.vector().size(), kFirstStep)) {}

FitJacobian FiniteDifferences::At(const FitState& state, const FitJacobian* known) {
  const ParameterVector& vector = problem_.vector();
  const int n = vector.size();
  FitJacobian jacobian(state.mean.size());
  for (size_t e = 0; e < jacobian.size(); ++e) {
    jacobian[e].setZero(state.residual[e].size(), n);
    if (known != nullptr) {
      jacobian[e].leftCols(vector.first_effect()) = (*known)[e].leftCols(vector.first_effect());
    }
  }
  if (known == nullptr) DifferentiateSetup(state, jacobian);
  for (int i = vector.first_effect(); i < n; ++i) {
    Differentiate(state, state.mean, false, i, jacobian);
  }
  return jacobian;
}

// Columns of the deviations, line shifts and model errors.
void FiniteDifferences::DifferentiateSetup(const FitState& state, FitJacobian& jacobian) {
  const ParameterVector& vector = problem_.vector();
  const bool middle_only = problem_.settings().middle_only;
  const BlockVectors origin =
      middle_only ? problem_.model().Expect(vector.ToParameters(state.x), false, true).mean
                  : state.mean;
  const bool same_directions = !problem_.model().set().description.posed;
  int first_amount = -1;
  for (int i = 0; i < vector.first_shift(); ++i) {
    if (!IsAmountOfLight(vector.DeviationName(i), same_directions)) {
      Differentiate(state, origin, middle_only, i, jacobian);
    } else if (first_amount < 0) {
      first_amount = i;
      Differentiate(state, origin, middle_only, i, jacobian);
    } else {
      const double reference = LogLightStep(state, first_amount);
      if (reference == 0) {  // at a bound of the amount itself
        Differentiate(state, origin, middle_only, i, jacobian);
        continue;
      }
      const double ratio = LogLightStep(state, i) / reference;
      for (Eigen::MatrixXd& j : jacobian) j.col(i) = ratio * j.col(first_amount);
    }
  }
  if (vector.shifts() > 0) {
    Differentiate(state, origin, middle_only, vector.first_shift(), jacobian);
  }
  for (int i = vector.first_model_error(); i < vector.first_effect(); ++i) {
    Differentiate(state, origin, middle_only, i, jacobian);
  }
}

// Column i by a one-sided difference from `origin`, the expectation at the state; for the first
// line shift the columns of all line shifts.
void FiniteDifferences::Differentiate(const FitState& state, const BlockVectors& origin,
                                      bool middle_only, int i, FitJacobian& jacobian, int attempt) {
  const ParameterVector& vector = problem_.vector();
  Eigen::VectorXd moved = state.x;
  double step = steps_[i];
  if (i >= vector.first_shift() && i < vector.first_model_error()) {
    moved.segment(vector.first_shift(), vector.shifts()).array() += step;
  } else {
    moved[i] += step;
    // At an upper bound the difference is taken downwards.
    if (std::abs(vector.Bounded(moved)[i] - moved[i]) > kAtBound) {
      moved[i] = state.x[i] - step;
      step = -step;
    }
  }
  const BlockVectors means =
      problem_.model().Expect(vector.ToParameters(moved), false, middle_only).mean;
  double square = 0;
  for (size_t e = 0; e < means.size(); ++e) {
    const int column = ColumnOf(i, static_cast<int>(e));
    if (column < 0) continue;
    jacobian[e].col(column) =
        (*problem_.whitening())(static_cast<int>(e), means[e] - origin[e]) / step;
    square += jacobian[e].col(column).squaredNorm();
  }
  if (AdaptStep(i, step, square) && attempt < kMostAttempts) {
    Differentiate(state, origin, middle_only, i, jacobian, attempt + 1);
  }
}

bool FiniteDifferences::AdaptStep(int i, double step, double square) {
  const bool first = steps_[i] == kFirstStep;
  const double slope = std::sqrt(std::max(square, kLeastSquare));
  // Rounded quantities (the raw value of a full pixel) do not change over a short step.
  const bool stays = i >= problem_.vector().first_effect() && !first &&
                     slope * std::abs(step) < kNoChange * kChange;
  steps_[i] = std::min(kLargestStep, stays ? kStepGrowth * std::abs(step) : kChange / slope);
  return stays ? std::abs(step) < kLargestStep : first && steps_[i] < kFirstStep;
}

// Column of a block that a move of parameter i fills: i, or the shift of the block's own plate
// position; -1: a dark frame, which no shift changes.
int FiniteDifferences::ColumnOf(int i, int block) const {
  const ParameterVector& vector = problem_.vector();
  if (i < vector.first_shift() || i >= vector.first_model_error()) return i;
  const SetModel& model = problem_.model();
  const int id = model.set().frames[model.FramesOf(block).front()].plate_position_id;
  if (id < 0) return -1;
  const auto& ids = model.position_ids();
  return vector.first_shift() +
         static_cast<int>(std::find(ids.begin(), ids.end(), id) - ids.begin());
}

// Change of the logarithm of the amount of light over a first step of parameter i.
double FiniteDifferences::LogLightStep(const FitState& state, int i) const {
  const auto log_light = [&](const Eigen::VectorXd& x) {
    const FrameSetup frame =
        DeviatedFrame(problem_.model().set(), 0, problem_.vector().ToParameters(x).deviations);
    double efficiency = 0;
    for (const QuantumEfficiencyCurve& curve : frame.sensor.quantum_efficiency) {
      for (double value : curve.quantum_efficiency) efficiency += value;
    }
    return std::log(frame.laser.power_w * frame.lens.transmission * efficiency *
                    PlateBrdf(frame.surface, frame.plate.incidence_angle_rad));
  };
  Eigen::VectorXd moved = state.x;
  moved[i] += kFirstStep;
  return log_light(moved) - log_light(state.x);
}

}  // namespace sightline
