// SPDX-License-Identifier: Apache-2.0
#include "planner_client/gain_model/reachable_gain_model.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <thread>

namespace sightline {
namespace {

// Answers that are remembered; some 10 MB.
constexpr size_t kMostRemembered = 100000;

}  // namespace

void ReachableGainModel::Keep(std::span<const Measurement> scans) {
  for (const Measurement& scan : scans) kept_.insert(ToArray(scan));
}

std::vector<bool> ReachableGainModel::Reached(std::span<const Measurement> measurements) {
  std::vector<char> result(measurements.size(), 1);
  std::vector<size_t> open;
  {
    const std::lock_guard lock(mutex_);
    for (size_t i = 0; i < measurements.size(); ++i) {
      const Key key = ToArray(measurements[i]);
      if (kept_.contains(key)) continue;
      if (const auto known = reached_.find(key); known != reached_.end()) {
        result[i] = known->second;
      } else {
        open.push_back(i);
      }
    }
  }
  std::atomic<size_t> next = 0;
  const auto work = [&] {
    for (size_t k = next++; k < open.size(); k = next++) {
      const Measurement& scan = measurements[open[k]];
      result[open[k]] = cell_->Reachable(scan, travel_of_(scan), false).reachable();
    }
  };
  const size_t threads =
      std::min<size_t>(std::max(1u, std::thread::hardware_concurrency()), open.size());
  std::vector<std::jthread> others;
  for (size_t t = 1; t < threads; ++t) others.emplace_back(work);
  work();
  others.clear();
  const std::lock_guard lock(mutex_);
  if (reached_.size() + open.size() > kMostRemembered) reached_.clear();
  for (const size_t i : open) reached_[ToArray(measurements[i])] = result[i] != 0;
  return {result.begin(), result.end()};
}

template <typename Answer, typename Ask>
absl::StatusOr<std::vector<Answer>> ReachableGainModel::OfReached(
    std::span<const Measurement> measurements, const Ask& ask,
    const std::function<Answer()>& unreached) {
  const std::vector<bool> reached = Reached(measurements);
  std::vector<Measurement> asked;
  for (size_t i = 0; i < measurements.size(); ++i) {
    if (reached[i]) asked.push_back(measurements[i]);
  }
  std::vector<Answer> answers;
  if (!asked.empty()) {
    absl::StatusOr<std::vector<Answer>> of_asked = ask(asked);
    if (!of_asked.ok() || asked.size() == measurements.size()) return of_asked;
    answers = *std::move(of_asked);
  }
  std::vector<Answer> result;
  size_t next = 0;
  for (size_t i = 0; i < measurements.size(); ++i) {
    result.push_back(reached[i] ? std::move(answers[next++]) : unreached());
  }
  return result;
}

ScanCoverage ReachableGainModel::Unreached() const {
  ScanCoverage coverage;
  coverage.feasibility = ScanFeasibility::kUnreachable;
  coverage.covered = TargetBits(measurable().size());
  coverage.covered_without_normal_gate = coverage.covered;
  coverage.validation_covered = TargetBits(validation_measurable().size());
  return coverage;
}

absl::StatusOr<std::vector<ScanGain>> ReachableGainModel::Gains(
    std::span<const Measurement> measurements, std::span<const float> known) {
  return OfReached<ScanGain>(
      measurements, [&](const auto& asked) { return gain_model_->Gains(asked, known); },
      [this] {
        ++unreached_;
        return ScanGain{.feasibility = ScanFeasibility::kUnreachable};
      });
}

absl::StatusOr<std::vector<ScanGain>> ReachableGainModel::WeightedGains(
    std::span<const Measurement> measurements, std::span<const float> weights) {
  return OfReached<ScanGain>(
      measurements, [&](const auto& asked) { return gain_model_->WeightedGains(asked, weights); },
      [this] {
        ++unreached_;
        return ScanGain{.feasibility = ScanFeasibility::kUnreachable};
      });
}

absl::StatusOr<std::vector<ScanCoverage>> ReachableGainModel::FastCoverage(
    std::span<const Measurement> measurements) {
  return OfReached<ScanCoverage>(
      measurements, [&](const auto& asked) { return gain_model_->FastCoverage(asked); },
      [this] {
        ++unreached_;
        return Unreached();
      });
}

absl::StatusOr<std::vector<ScanCoverage>> ReachableGainModel::ExactCoverage(
    std::span<const Measurement> measurements) {
  auto coverages = OfReached<ScanCoverage>(
      measurements, [&](const auto& asked) { return gain_model_->ExactCoverage(asked); },
      [this] { return Unreached(); });
  if (!coverages.ok()) return coverages;
  for (size_t i = 0; i < measurements.size(); ++i) {
    ScanCoverage& coverage = (*coverages)[i];
    if (coverage.feasibility != ScanFeasibility::kFeasible ||
        coverage.last_frame < coverage.first_frame || kept_.contains(ToArray(measurements[i]))) {
      continue;
    }
    const ScanTravel travel{coverage.first_frame * scan_step_m_,
                            coverage.last_frame * scan_step_m_};
    if (!cell_->Reachable(measurements[i], travel, false).reachable()) coverage = Unreached();
  }
  return coverages;
}

}  // namespace sightline
