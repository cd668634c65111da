// SPDX-License-Identifier: Apache-2.0
// How well a fitted model predicts recordings that it was not fitted to.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

// Recordings that are not to be used for the fit: every fourth plate position and every fourth dark
// frame, by chance of the seed. Each recording is in one of the folds 0 ... kFolds - 1.
constexpr int kFolds = 4;
std::vector<bool> HeldOutRecordings(const RecordedSet& set, uint64_t seed, int fold = 0);

// Probability of a chi squared at least as large.
double ChiSquaredPValue(double chi_squared, double degrees_of_freedom);

// What a fit says of entries that it did not use: its parameters, moved to the best for the entries
// used (one Gauss-Newton step; the fit is close).
class Prediction {
 public:
  Prediction(const FitResult& fit, const std::vector<bool>& use_entry);

  // What is predicted together; empty to begin with.
  struct Sum {
    double squares = 0;
    int numbers = 0;
    Eigen::MatrixXd information;  // of the parameters, with that of these entries
    Eigen::VectorXd gradient;
  };
  void Add(int entry, Sum* sum) const;

  // Parameters that the used entries do not determine (the line's place on another plate position)
  // count as far as they are uncertain: r' (I + J C J')^-1 r with the whitened residual r, the
  // Jacobian J and the covariance C of the parameters by the entries used; and log |I + J C J'|.
  double ChiSquared(const Sum& sum) const;
  double LogDeterminant(const Sum& sum) const;

 private:
  const FitResult& fit_;
  Eigen::VectorXd step_;
  Eigen::MatrixXd information_;
};

struct PredictedFit {
  double chi_squared = 0;
  int degrees_of_freedom = 0;
};
PredictedFit PredictEntries(const FitResult& fit, const std::vector<bool>& use_entry,
                            const std::vector<bool>& predict_entry);

// Entries of recordings that are all held out, and entries of recordings none of which is.
struct EntrySplit {
  std::vector<bool> used, held_out;
};
EntrySplit SplitEntries(const SetModel& model, const std::vector<bool>& held_out_recording);

// Chi squared of every recording by a fit to the other folds: cross-validation, so that whatever
// recording an effect shows in is held out once.
PredictedFit CrossValidate(const SetModel& model, const FitResult& fit, uint64_t seed);

}  // namespace sightline
