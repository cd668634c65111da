// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/statistics/square.h"

namespace sightline {
namespace {

// Above these shares of saturation and of clipped pixels the saturation of single pixels reduces
// the variance. Chosen; EMVA 1288 R4.0, clause 6.6, uses 0 to 70 % of saturation for the gain.
constexpr double kLargestShareOfSaturation = 0.9, kLargestClippedShare = 1e-6;
// Fewer bright steps do not show whether the model fits. Chosen.
constexpr int kFewestBrightSteps = 6;

// Dark steps: means over the steps of their means and variances.
struct DarkLevel {
  double mean_dn = 0, variance_dn2 = 0;
};

DarkLevel MeanDarkLevel(std::span<const FlatFieldStatistics> steps) {
  double mean = 0, count = 0, variance = 0;
  for (const FlatFieldStatistics& step : steps) {
    if (!step.dark) continue;
    mean += step.MeanDn();
    variance += step.noise.variance_1_apart_dn2->value;
    ++count;
  }
  if (count > 0) {
    mean /= count;
    variance /= count;
  }
  return {mean, variance};
}

double LongestExposure(std::span<const FlatFieldStatistics> steps) {
  double longest_s = 0;
  for (const FlatFieldStatistics& step : steps)
    longest_s = std::max(longest_s, step.exposure_time_s);
  return longest_s;
}

// Photons of a step; relative to the longest exposure if they are not given.
double PhotonsOf(const FlatFieldStatistics& step, bool has_photons, double longest_s) {
  if (step.dark) return 0;
  if (has_photons) return *step.photons;
  return step.exposure_time_s / std::max(longest_s, std::numeric_limits<double>::min());
}

// Least-squares slopes through the origin over all bright steps: variance over signal, and signal
// over photons.
struct InitialSlopes {
  double gain_sum = 0, gain_weight = 0, efficiency_sum = 0, efficiency_weight = 0;
  double largest_photons = 0;

  void Add(double signal_dn, double variance_dn2, double photons) {
    gain_sum += signal_dn * variance_dn2;
    gain_weight += signal_dn * signal_dn;
    efficiency_sum += photons * signal_dn;
    efficiency_weight += photons * photons;
    largest_photons = std::max(largest_photons, photons);
  }
  double Gain() const { return std::max(gain_sum / gain_weight, 1e-6); }
  double Efficiency() const { return efficiency_sum / efficiency_weight / Gain(); }
};

void FillMoments(TransferObservations* data) {
  const Eigen::Index n = data->size();
  data->mean_dn.resize(n);
  data->variance_dn2.resize(n);
  data->noise_of_mean_dn.resize(n);
  data->noise_of_variance_dn2.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const FlatFieldStatistics& step = *data->steps[i];
    const Estimate& variance = *step.noise.variance_1_apart_dn2;
    data->mean_dn[i] = step.MeanDn();
    data->variance_dn2[i] = variance.value;
    data->noise_of_mean_dn[i] = std::sqrt(std::max(variance.value, kQuantisationVariance_dn2) /
                                          step.frames() / step.pair.pixels);
    // Chi squared with one degree of freedom for each pixel of each disjoint pair of frames.
    const double differences = std::max(1.0, step.frames() / 2.0) * step.pair.pixels;
    data->noise_of_variance_dn2[i] =
        std::max(std::max(variance.value, kQuantisationVariance_dn2) * std::sqrt(2 / differences),
                 variance.standard_error);
  }
}

// Values that scales and starting values are computed from.
struct StartingPoint {
  DarkLevel dark;
  double gain = 1, efficiency = 1, longest_s = 0, largest_photons = 0;
};

// Appends parameters to layout and starting values.
struct ParameterList {
  TransferLayout layout;
  std::vector<double> start;

  int Add(const char* name, const char* unit, double scale, double value) {
    layout.scale.push_back(scale);
    layout.name_and_unit.emplace_back(name, unit);
    start.push_back(value / scale);
    return static_cast<int>(start.size()) - 1;
  }
};

void AddLinearModel(const TransferData& transfer, const StartingPoint& at, ParameterList* list) {
  TransferLayout& layout = list->layout;
  const double electrons = at.efficiency * at.largest_photons;
  layout.gain = list->Add("gain_dn_per_electron", "DN/e-", at.gain, at.gain);
  layout.efficiency =
      list->Add(transfer.has_photons ? "quantum_efficiency" : "electrons_at_longest_exposure",
                transfer.has_photons ? "" : "e-", std::max(at.efficiency, 1e-12), at.efficiency);
  if (transfer.fit_dark_current) {
    layout.dark_current =
        list->Add("dark_current_electrons_per_s", "e-/s",
                  std::max(1.0 / at.gain, 1e-3 * electrons) / std::max(at.longest_s, 1e-9), 0);
  }
  layout.black_level =
      list->Add("black_level_dn", "DN", std::max(1.0, at.dark.mean_dn), at.dark.mean_dn);
  const double dark_electrons2 = std::max(
      (at.dark.variance_dn2 - kQuantisationVariance_dn2) / Square(at.gain), 0.01 / Square(at.gain));
  layout.dark_variance =
      list->Add("dark_noise_variance_electrons2", "e-^2", dark_electrons2, dark_electrons2);
}

// Terms start at zero. Their scales are sizes that a good camera may have: 1 % at saturation, a
// thousandth of the largest exposure.
void AddTerms(const TransferData& transfer, const std::set<TransferTerm>& terms,
              const StartingPoint& at, ParameterList* list) {
  TransferLayout& layout = list->layout;
  if (terms.contains(TransferTerm::kQuadraticResponse)) {
    layout.quadratic = list->Add("quadratic_response", "", 0.01, 0);
  }
  if (terms.contains(TransferTerm::kCubicResponse)) {
    layout.cubic = list->Add("cubic_response", "", 0.01, 0);
  }
  if (terms.contains(TransferTerm::kBrighterFatter)) {
    layout.brighter_fatter = list->Add("variance_deficit_at_saturation", "", 0.01, 0);
  }
  if (terms.contains(TransferTerm::kExposureTimeOffset)) {
    layout.time_offset = list->Add("exposure_time_offset_s", "s", 1e-3 * at.longest_s, 0);
  }
  if (terms.contains(TransferTerm::kStrayLight)) {
    layout.stray =
        list->Add(transfer.has_photons ? "stray_photons" : "stray_light_of_longest_exposure",
                  transfer.has_photons ? "photons" : "", 1e-3 * at.largest_photons, 0);
  }
}

}  // namespace

bool IsBelowSaturation(const FlatFieldStatistics& step, double dark_mean_dn,
                       double saturation_signal_dn) {
  return step.MeanDn() - dark_mean_dn < kLargestShareOfSaturation * saturation_signal_dn &&
         step.share_at_largest <= kLargestClippedShare;
}

absl::StatusOr<TransferProblem> MakeTransferProblem(const TransferData& transfer,
                                                    const std::set<TransferTerm>& terms,
                                                    FoldPart part, int fold) {
  StartingPoint at{.dark = MeanDarkLevel(transfer.steps),
                   .longest_s = LongestExposure(transfer.steps)};
  TransferProblem problem;
  TransferObservations& data = problem.data;
  data.whole_photons = transfer.has_photons;
  InitialSlopes slopes;
  int bright = 0;
  for (size_t i = 0; i < transfer.steps.size(); ++i) {
    const FlatFieldStatistics& step = transfer.steps[i];
    if (!step.dark && !IsBelowSaturation(step, at.dark.mean_dn, transfer.saturation_signal_dn)) {
      continue;
    }
    const double photons = PhotonsOf(step, transfer.has_photons, at.longest_s);
    if (!step.dark) {
      slopes.Add(step.MeanDn() - at.dark.mean_dn,
                 step.noise.variance_1_apart_dn2->value - at.dark.variance_dn2, photons);
      data.whole_photons &= photons == std::round(photons);
    }
    const bool in_fold = static_cast<int>(i % kTransferFolds) == fold;
    if (part != FoldPart::kAll && in_fold != (part == FoldPart::kFoldOnly)) continue;
    bright += !step.dark;
    data.steps.push_back(&step);
    data.index.push_back(i);
    data.photons.push_back(photons);
  }
  if (part != FoldPart::kFoldOnly && bright < kFewestBrightSteps) {
    return absl::FailedPreconditionError(
        absl::StrCat("the set has ", bright, " steps with light below saturation, needs at least ",
                     kFewestBrightSteps));
  }
  FillMoments(&data);
  at.gain = slopes.Gain();
  at.efficiency = slopes.Efficiency();
  at.largest_photons = slopes.largest_photons;
  data.black_level_dn = at.dark.mean_dn;
  data.black_level_deviation_dn = transfer.black_level_deviation_dn;
  data.saturation_electrons = std::max(transfer.saturation_signal_dn / at.gain, 1.0);
  ParameterList list;
  AddLinearModel(transfer, at, &list);
  AddTerms(transfer, terms, at, &list);
  problem.layout = std::move(list.layout);
  problem.start = Eigen::Map<const Eigen::VectorXd>(list.start.data(),
                                                    static_cast<Eigen::Index>(list.start.size()));
  return problem;
}

}  // namespace sightline
