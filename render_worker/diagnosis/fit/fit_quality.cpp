// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/fit_quality.h"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <map>

#include "core/random/counter_random.h"
#include "render_worker/diagnosis/fit/linear_fit.h"

namespace sightline {

std::vector<bool> HeldOutRecordings(const RecordedSet& set, uint64_t seed, int fold) {
  std::vector<bool> held_out(set.frames.size(), false);
  const auto uniform = [&](const char* what, int id) {
    return CounterRandom(DeriveSeed(seed, what), static_cast<uint64_t>(id)).Uniform();
  };
  // One of every four consecutive ones, so that a quarter is held out for every seed.
  std::map<int, int> order;  // of plate positions
  for (const RecordedFrame& frame : set.frames) {
    if (frame.plate_position_id >= 0) order.emplace(frame.plate_position_id, 0);
  }
  int position = 0;
  for (auto& [id, index] : order) index = position++;
  const auto chosen = [&](const char* what, int index) {
    const int first = static_cast<int>(kFolds * uniform(what, index / kFolds));
    return index % kFolds == (first + fold) % kFolds;
  };
  int dark = 0;
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const int id = set.frames[f].plate_position_id;
    held_out[f] =
        id >= 0 ? chosen("held-out positions", order[id]) : chosen("held-out dark", dark++);
  }
  return held_out;
}

double ChiSquaredPValue(double chi_squared, double degrees_of_freedom) {
  if (degrees_of_freedom <= 0) return 1;
  return boost::math::gamma_q(0.5 * degrees_of_freedom, 0.5 * std::max(0.0, chi_squared));
}

BlockSplit SplitBlocks(const SetModel& model, const std::vector<bool>& held_out_recording) {
  BlockSplit split;
  for (int e = 0; e < model.blocks(); ++e) {
    const std::vector<int>& frames = model.FramesOf(e);
    const auto out = [&](int f) { return static_cast<bool>(held_out_recording[f]); };
    split.used.push_back(std::none_of(frames.begin(), frames.end(), out));
    split.held_out.push_back(std::all_of(frames.begin(), frames.end(), out));
  }
  return split;
}

Prediction::Prediction(const FitResult& fit, const std::vector<bool>& use_block) : fit_(fit) {
  const LinearFit used(fit, use_block);
  step_ = used.Step();
  information_ = used.information();
}

void Prediction::Add(int block, Sum* sum) const {
  const auto e = static_cast<size_t>(block);
  Eigen::MatrixXd jacobian = fit_.jacobian[e];
  for (size_t i = 0; i < fit_.at_bound.size(); ++i) {
    if (fit_.at_bound[i]) jacobian.col(static_cast<Eigen::Index>(i)).setZero();
  }
  const Eigen::VectorXd residual = fit_.residual[e] - jacobian * step_;
  if (sum->numbers == 0) {
    sum->information = information_;
    sum->gradient.setZero(step_.size());
  }
  sum->squares += residual.squaredNorm();
  sum->numbers += static_cast<int>(residual.size());
  sum->information.noalias() += jacobian.transpose() * jacobian;
  sum->gradient.noalias() += jacobian.transpose() * residual;
}

double Prediction::ChiSquared(const Sum& sum) const {
  if (sum.numbers == 0) return 0;
  return sum.squares - sum.gradient.dot(sum.information.llt().solve(sum.gradient));
}

double Prediction::LogDeterminant(const Sum& sum) const {
  if (sum.numbers == 0) return 0;
  const auto log_determinant = [](const Eigen::MatrixXd& matrix) {
    return 2 * matrix.llt().matrixLLT().diagonal().array().log().sum();
  };
  return log_determinant(sum.information) - log_determinant(information_);
}

PredictedFit PredictBlocks(const FitResult& fit, const std::vector<bool>& use_block,
                           const std::vector<bool>& predict_block) {
  const Prediction prediction(fit, use_block);
  Prediction::Sum sum;
  for (size_t e = 0; e < fit.residual.size(); ++e) {
    if (predict_block[e]) prediction.Add(static_cast<int>(e), &sum);
  }
  return {prediction.ChiSquared(sum), sum.numbers};
}

PredictedFit CrossValidate(const SetModel& model, const FitResult& fit, uint64_t seed) {
  PredictedFit all;
  for (int fold = 0; fold < kFolds; ++fold) {
    const BlockSplit split = SplitBlocks(model, HeldOutRecordings(model.set(), seed, fold));
    const PredictedFit predicted = PredictBlocks(fit, split.used, split.held_out);
    all.chi_squared += predicted.chi_squared;
    all.degrees_of_freedom += predicted.degrees_of_freedom;
  }
  return all;
}

}  // namespace sightline
