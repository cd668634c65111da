// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/predictive_check.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <string_view>

#include "absl/strings/str_format.h"
#include "render_worker/diagnosis/fit/fit_quality.h"
#include "render_worker/diagnosis/fit/model_error.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

namespace {

// Names of the groups of a block: its statistic, and either "dark frames" or the values of the
// set-up that all its recordings share.
std::vector<std::string> GroupsOf(const SetModel& model, int block) {
  std::vector<std::string> names = {std::string(model.StatisticOf(block).name())};
  const RecordedSet& set = model.set();
  const std::vector<int>& frames = model.FramesOf(block);
  const auto dark = [&](int f) { return set.frames[f].plate_position_id < 0; };
  if (std::all_of(frames.begin(), frames.end(), dark)) {
    names.emplace_back("dark frames");
    return names;
  }
  struct Quantity {
    const char* name;
    double (*of)(const FrameSetup& frame);
  };
  static constexpr Quantity kQuantities[] = {
      {"exposure_time_s", [](const FrameSetup& frame) { return frame.exposure_time_s; }},
      {"f_number", [](const FrameSetup& frame) { return frame.lens.f_number; }},
      {"camera_distance_m", [](const FrameSetup& frame) { return frame.plate.camera_distance_m; }},
      {"focus_distance_m",
       [](const FrameSetup& frame) { return frame.lens.focus_distance_m.value_or(0); }},
      {"laser_distance_m", [](const FrameSetup& frame) { return frame.plate.laser_distance_m; }},
  };
  for (const auto& [name, of] : kQuantities) {
    const double value = of(set.frames[frames.front()].nominal);
    const auto same = [&, of = of](int f) { return of(set.frames[f].nominal) == value; };
    if (std::all_of(frames.begin(), frames.end(), same)) {
      names.push_back(absl::StrFormat("%s %.4g", name, value));
    }
  }
  return names;
}

}  // namespace

PredictiveCheck CheckPredictions(const SetModel& model, const FitResult& fit, const FitResult& null,
                                 uint64_t seed) {
  std::map<std::string, PredictedGroup, std::less<>> groups;
  std::vector<std::vector<std::string>> groups_of;
  for (int e = 0; e < model.blocks(); ++e) groups_of.push_back(GroupsOf(model, e));
  PredictiveCheck check;
  for (int fold = 0; fold < kFolds; ++fold) {
    const BlockSplit split = SplitBlocks(model, HeldOutRecordings(model.set(), seed, fold));
    const std::vector<DividedBlock> divided = DivideBlocks(model, fit, split, fold);
    const Prediction prediction(fit, split.used, divided);
    std::map<std::string, Prediction::Sum, std::less<>> sums;
    Prediction::Sum all;
    const auto change = [&](int e) { return (*fit.whitening)(e, fit.mean[e] - null.mean[e]); };
    // `data`: index of a block, or part of a block; `squared_change`: |d|^2 of it.
    const auto add = [&](int e, const auto& data, double squared_change) {
      prediction.Add(data, &all);
      for (const std::string& name : groups_of[e]) {
        prediction.Add(data, &sums[name]);
        // The covariance of a corrected model contains this error.
        if (!model.is_corrected()) {
          groups[name].model_error += kEffectError * kEffectError * squared_change;
        }
      }
    };
    for (int e = 0; e < model.blocks(); ++e) {
      if (!split.held_out[e]) continue;
      check.log_score -= 0.5 * fit.whitening->LogDeterminant(e);
      add(e, e, change(e).squaredNorm());
    }
    for (const DividedBlock& part : divided) {
      check.log_score -= 0.5 * part.log_determinant;
      const Eigen::Index m = part.held_out.residual.size();
      add(part.block, part.held_out, change(part.block).head(m).squaredNorm() / kObservedParts);
    }
    check.log_score -= 0.5 * (prediction.ChiSquared(all) + prediction.LogDeterminant(all));
    for (const auto& [name, sum] : sums) {
      PredictedGroup& group = groups[name];
      group.name = name;
      group.chi_squared += prediction.ChiSquared(sum);
      group.degrees_of_freedom += sum.numbers;
    }
  }
  for (auto& [name, group] : groups) {
    // Patnaik's approximation: c times a chi squared of h degrees of freedom has the same mean and
    // variance as the noncentral chi squared.
    const double n = group.degrees_of_freedom, lambda = group.model_error;
    if (n == 0) continue;  // texture of lines that are all clipped
    const double c = (n + 2 * lambda) / (n + lambda);
    const double h = (n + lambda) * (n + lambda) / (n + 2 * lambda);
    group.p_value = ChiSquaredPValue(kEvidenceWeight * group.chi_squared / c, h);
    check.p_value = std::min(check.p_value, group.p_value);
    check.groups.push_back(group);
  }
  check.p_value = std::min(1.0, check.p_value * static_cast<double>(check.groups.size()));
  return check;
}

void AddTest(const PredictedGroup& test, PredictiveCheck* check) {
  check->p_value = std::min(1.0, 2 * std::min(check->p_value, test.p_value));
  check->groups.push_back(test);
}

}  // namespace sightline
