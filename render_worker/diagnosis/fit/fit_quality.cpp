// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/fit_quality.h"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <map>

#include "core/random/counter_random.h"
#include "render_worker/diagnosis/fit/linear_fit.h"

namespace sightline {

namespace {

// Logarithm of the determinant of the leading m x m block of a block's covariance. The diagonal of
// the Cholesky factor L follows from unit vectors u_j, because (L^-1 u_j)_j = 1 / L_jj.
double LeadingLogDeterminant(const FitResult& fit, int block, Eigen::Index m) {
  const Eigen::Index size = fit.residual[static_cast<size_t>(block)].size();
  double sum = 0;
  for (Eigen::Index j = 0; j < m; ++j) {
    sum -= 2 * std::log((*fit.whitening)(block, Eigen::VectorXd::Unit(size, j))[j]);
  }
  return sum;
}

// The Jacobian with columns of 0 for the parameters at an active bound.
Eigen::MatrixXd OfFreeParameters(const FitResult& fit, Eigen::MatrixXd jacobian) {
  for (size_t i = 0; i < fit.at_bound.size(); ++i) {
    if (fit.at_bound[i]) jacobian.col(static_cast<Eigen::Index>(i)).setZero();
  }
  return jacobian;
}

}  // namespace

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

std::vector<DividedBlock> DivideBlocks(const SetModel& model, const FitResult& fit,
                                       const BlockSplit& split, int fold) {
  std::vector<DividedBlock> divided;
  for (int e = 0; e < model.blocks(); ++e) {
    if (split.used[e] || split.held_out[e] || model.ObservedParts(e).empty()) continue;
    divided.push_back(DivideBlock(fit, e, model.observed()[e], model.ObservedParts(e), fold));
  }
  return divided;
}

DividedBlock DivideBlock(const FitResult& fit, int block, const Eigen::VectorXd& observed,
                         const BlockVectors& parts, int held_out) {
  const auto e = static_cast<size_t>(block);
  const auto count = static_cast<double>(parts.size());
  const Eigen::Index m = parts.front().size();
  // The covariance of the data is `variance` times that of the block's leading components.
  const auto whiten = [&](const Eigen::VectorXd& data, double variance) -> WhitenedData {
    // L is lower triangular: the leading components of L^-1 d depend on those of d alone.
    Eigen::VectorXd difference = Eigen::VectorXd::Zero(observed.size());
    difference.head(m) = data - observed.head(m);
    const Eigen::VectorXd residual = fit.residual[e] + (*fit.whitening)(block, difference);
    return {residual.head(m) / std::sqrt(variance),
            fit.jacobian[e].topRows(m) / std::sqrt(variance)};
  };
  Eigen::VectorXd others = Eigen::VectorXd::Zero(m);
  for (size_t k = 0; k < parts.size(); ++k) {
    if (static_cast<int>(k) != held_out) others += parts[k] / (count - 1);
  }
  DividedBlock divided;
  divided.block = block;
  divided.used = whiten(others, count / (count - 1));
  divided.held_out = whiten(parts[static_cast<size_t>(held_out)], count);
  divided.log_determinant =
      LeadingLogDeterminant(fit, block, m) + static_cast<double>(m) * std::log(count);
  return divided;
}

Prediction::Prediction(const FitResult& fit, const std::vector<bool>& use_block,
                       const std::vector<DividedBlock>& divided)
    : fit_(fit) {
  const LinearFit used(fit, use_block);
  step_ = used.Step();
  information_ = used.information();
  if (divided.empty()) return;
  Eigen::VectorXd gradient = information_ * step_;
  for (const DividedBlock& each : divided) {
    const Eigen::MatrixXd jacobian = OfFreeParameters(fit, each.used.jacobian);
    information_.noalias() += jacobian.transpose() * jacobian;
    gradient.noalias() += jacobian.transpose() * each.used.residual;
  }
  step_ = information_.llt().solve(gradient);
}

void Prediction::Add(int block, Sum* sum) const {
  const auto e = static_cast<size_t>(block);
  Add({fit_.residual[e], fit_.jacobian[e]}, sum);
}

void Prediction::Add(const WhitenedData& data, Sum* sum) const {
  const Eigen::MatrixXd jacobian = OfFreeParameters(fit_, data.jacobian);
  const Eigen::VectorXd residual = data.residual - jacobian * step_;
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
    const std::vector<DividedBlock> divided = DivideBlocks(model, fit, split, fold);
    const Prediction prediction(fit, split.used, divided);
    Prediction::Sum sum;
    for (int e = 0; e < model.blocks(); ++e) {
      if (split.held_out[e]) prediction.Add(e, &sum);
    }
    for (const DividedBlock& each : divided) prediction.Add(each.held_out, &sum);
    all.chi_squared += prediction.ChiSquared(sum);
    all.degrees_of_freedom += sum.numbers;
  }
  return all;
}

}  // namespace sightline
