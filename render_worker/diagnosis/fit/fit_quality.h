// SPDX-License-Identifier: Apache-2.0
// How well a fitted model predicts recordings that it was not fitted to: cross-validation in four
// folds, with each fold's fit by one Gauss-Newton step from the fit to all recordings.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// Folds of the cross-validation. Chosen: three quarters of the recordings still determine a fit,
// and each fold holds out several plate positions of a usual set.
constexpr int kFolds = 4;
static_assert(kFolds == kObservedParts);
// True for the recordings held out in a fold 0 ... kFolds - 1: one of every four plate positions
// and of every four dark frames, chosen at random by the seed. Each recording is in exactly one
// fold.
std::vector<bool> HeldOutRecordings(const RecordedSet& set, uint64_t seed, int fold = 0);

// Probability of a chi squared at least as large; 1 without degrees of freedom.
double ChiSquaredPValue(double chi_squared, double degrees_of_freedom);

// Whitened residual at the fit, and Jacobian of the whitened expectation.
struct WhitenedData {
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
};

// An observation block whose recordings are in several folds, divided by pixels instead
// (SetStatistic::ObservedOfParts): one of K = kObservedParts parts is held out, the others are
// used. With S, the leading m x m block of the block's covariance, part k is y_k ~ N(mu, K S), and
// the mean of the others is distributed as N(mu, K / (K - 1) S).
struct DividedBlock {
  int block = -1;
  WhitenedData used;           // mean of the K - 1 parts that are used
  WhitenedData held_out;       // the part that is held out
  double log_determinant = 0;  // log |K S|
};
// `observed`: the components of the whole block at the fit; `parts`: m components of each part;
// `held_out`: index of a part.
DividedBlock DivideBlock(const FitResult& fit, int block, const Eigen::VectorXd& observed,
                         const BlockVectors& parts, int held_out);

// Predicts observation blocks from the others. The parameters are those of the fit, moved to the
// optimum of the blocks used by one Gauss-Newton step, which suffices close to the optimum of all.
class Prediction {
 public:
  // `use_block`: true for the blocks to predict from; the used parts of `divided` count in
  // addition. `fit` must outlive this.
  Prediction(const FitResult& fit, const std::vector<bool>& use_block,
             const std::vector<DividedBlock>& divided = {});

  // Sums over the blocks and parts that are predicted together.
  struct Sum {
    double squares = 0;           // r'r of the whitened residuals r
    int numbers = 0;              // components
    Eigen::MatrixXd information;  // C^-1 + J'J
    Eigen::VectorXd gradient;     // J'r
  };
  void Add(int block, Sum* sum) const;
  void Add(const WhitenedData& data, Sum* sum) const;

  // Chi squared r' (I + J C J')^-1 r and log-determinant log |I + J C J'| of the prediction, with
  // the whitened residual r, the Jacobian J and the covariance C of the parameters given the blocks
  // used. Parameters that these do not determine (the line's position on another plate position)
  // thereby count with their uncertainty.
  double ChiSquared(const Sum& sum) const;
  double LogDeterminant(const Sum& sum) const;

 private:
  const FitResult& fit_;
  Eigen::VectorXd step_;
  Eigen::MatrixXd information_;
};

// Chi squared of the blocks of `predict_block`, predicted from those of `use_block`. No block is
// divided.
struct PredictedFit {
  double chi_squared = 0;
  int degrees_of_freedom = 0;
};
PredictedFit PredictBlocks(const FitResult& fit, const std::vector<bool>& use_block,
                           const std::vector<bool>& predict_block);

// Blocks whose recordings are all held out, and blocks none of whose recordings is.
struct BlockSplit {
  std::vector<bool> used, held_out;
};
BlockSplit SplitBlocks(const SetModel& model, const std::vector<bool>& held_out_recording);
// The blocks that `split`, of fold `fold`, neither uses nor holds out, as far as their statistics
// have parts. Part `fold` is held out.
std::vector<DividedBlock> DivideBlocks(const SetModel& model, const FitResult& fit,
                                       const BlockSplit& split, int fold);

// Chi squared of every recording, predicted from the other folds. Each recording in which an effect
// shows is held out once. Blocks whose recordings are in several folds are divided (DividedBlock).
PredictedFit CrossValidate(const SetModel& model, const FitResult& fit, uint64_t seed);

}  // namespace sightline
