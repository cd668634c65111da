// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/fit_problem.h"

#include <utility>

namespace sightline {

void FitProblem::RenewCovariance(const FitSettings::Round& round, FitState& state) {
  SetModel::Expectation expectation = model_.Expect(vector_.ToParameters(state.x), true);
  BlockVectors unexplained;
  for (size_t e = 0; e < expectation.mean.size(); ++e) {
    const Eigen::VectorXd& observed = Observed()[e];
    const Eigen::ArrayXd residual = (observed - expectation.mean[e]).array();
    const double background = observed.size() > 0 ? observed.minCoeff() : 0;
    unexplained.push_back(((round.of_signal * (observed.array() - background)).square() +
                           (round.of_residual * residual).square())
                              .sqrt()
                              .matrix());
  }
  whitening_ = std::make_shared<Whitening>(expectation.covariance, unexplained);
  state.mean = std::move(expectation.mean);
}

void FitProblem::Compare(FitState& state) const {
  state.residual.resize(state.mean.size());
  state.chi_squared = 0;
  for (size_t e = 0; e < state.mean.size(); ++e) {
    state.residual[e] = (*whitening_)(static_cast<int>(e), Observed()[e] - state.mean[e]);
    if (Used(e)) state.chi_squared += state.residual[e].squaredNorm();
  }
  state.total = state.chi_squared + vector_.Penalty(state.x);
}

FitState FitProblem::At(const Eigen::VectorXd& x) const {
  FitState state;
  state.x = vector_.Bounded(x);
  state.mean = model_.Expect(vector_.ToParameters(state.x), false).mean;
  Compare(state);
  return state;
}

double FitProblem::LogDeterminant() const {
  double sum = 0;
  for (size_t e = 0; e < model_.observed().size(); ++e) {
    if (Used(e)) sum += whitening_->LogDeterminant(static_cast<int>(e));
  }
  return sum;
}

}  // namespace sightline
