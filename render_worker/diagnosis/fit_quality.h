// How well a fitted model describes a set: recordings and observables, fitted and not.
#pragma once

#include <vector>

#include "render_worker/diagnosis/fit.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Recordings that are not to be used for the fit: every fourth plate position and every fourth dark
// frame, by chance of the seed. Each recording is in one of the folds 0 ... kFolds - 1.
constexpr int kFolds = 4;
std::vector<bool> HeldOutRecordings(const RecordedSet& set, uint64_t seed, int fold = 0);

// Probability of a chi squared at least as large.
double ChiSquaredPValue(double chi_squared, int degrees_of_freedom);

// Chi squared of entries by a fit that did not use them: the fit's parameters, moved to the best
// for the entries used (one Gauss-Newton step; the fit is close).
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

v1::ModelFit DescribeFit(const SetModel& model, const FitResult& fit);

// On held-out recordings, and on every kind of observable as if it alone had not been fitted.
v1::HeldOutImprovement DescribeImprovement(const SetModel& model, const FitResult& null,
                                           const FitResult& best, uint64_t seed);

}  // namespace sightline
