// SPDX-License-Identifier: Apache-2.0
#include "planner_client/replanning/measured_gain_model.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Density at which a surface has this uncertainty; 0 if it is no better than the prior.
double EquivalentDensity(const SurfacePrior& prior, double uncertainty_m) {
  if (!(uncertainty_m < prior.standard_deviation_m)) return 0;
  return DensityForUncertainty(prior, std::max(uncertainty_m, 1e-9 * prior.standard_deviation_m));
}

}  // namespace

MeasuredGainModel::MeasuredGainModel(std::unique_ptr<GainModel> gain_model,
                                     std::vector<Measurement> scans, MeasuredTargets planned,
                                     std::optional<MeasuredTargets> fresh,
                                     double relaxed_uncertainty_m)
    : gain_model_(std::move(gain_model)),
      scans_(std::move(scans)),
      planned_(std::move(planned)),
      fresh_(std::move(fresh)),
      relaxed_uncertainty_m_(relaxed_uncertainty_m) {}

std::optional<size_t> MeasuredGainModel::MeasuredIndex(const Measurement& scan) const {
  const auto found = std::find(scans_.begin(), scans_.end(), scan);
  if (found == scans_.end()) return std::nullopt;
  return static_cast<size_t>(found - scans_.begin());
}

template <typename Change>
absl::StatusOr<std::vector<ScanCoverage>> MeasuredGainModel::AsMeasured(
    absl::StatusOr<std::vector<ScanCoverage>> coverages, std::span<const Measurement> measurements,
    const Change& change) const {
  if (!coverages.ok()) return coverages;
  for (size_t i = 0; i < measurements.size(); ++i) {
    const auto measured = MeasuredIndex(measurements[i]);
    if (!measured) continue;
    ScanCoverage& coverage = (*coverages)[i];
    coverage.feasibility = ScanFeasibility::kFeasible;
    coverage.covered = planned_.covered[*measured];
    change(*measured, coverage);
  }
  return coverages;
}

absl::StatusOr<std::vector<ScanCoverage>> MeasuredGainModel::FastCoverage(
    std::span<const Measurement> measurements) {
  const auto change = [&](size_t measured, ScanCoverage& coverage) {
    coverage.shares = {};
    if (!ScoresPlans()) return;
    // Information that the scan's points add to those of the measured scans before it.
    const size_t scan_count = scans_.size();
    for (size_t t = 0; t < planned_.priors.size(); ++t) {
      if (!planned_.toleranced.bits.Test(t)) continue;
      const auto after = [&](size_t scan) {
        return EquivalentDensity(planned_.priors[t],
                                 planned_.uncertainties.after_each_scan_m[t * scan_count + scan]);
      };
      const double added = after(measured) - (measured > 0 ? after(measured - 1) : 0);
      if (!(added > 0)) continue;
      coverage.shares.targets.push_back(static_cast<uint32_t>(t));
      coverage.shares.share.push_back(
          static_cast<float>(added / planned_.toleranced.admissible_density[t]));
    }
  };
  return AsMeasured(gain_model_->FastCoverage(measurements), measurements, change);
}

absl::StatusOr<std::vector<ScanCoverage>> MeasuredGainModel::ExactCoverage(
    std::span<const Measurement> measurements) {
  const auto change = [&](size_t measured, ScanCoverage& coverage) {
    coverage.covered_without_normal_gate = coverage.covered;
    coverage.measurement_points = planned_.points[measured];
    if (fresh_) coverage.validation_covered = fresh_->covered[measured];
  };
  return AsMeasured(gain_model_->ExactCoverage(measurements), measurements, change);
}

absl::StatusOr<MeasuredGainModel::Counts> MeasuredGainModel::Count(
    const MeasuredTargets& targets, std::span<const Measurement> scans) const {
  std::vector<Measurement> simulated;
  bool any_measured = false;
  for (const Measurement& scan : scans) {
    if (MeasuredIndex(scan)) {
      any_measured = true;
    } else {
      simulated.push_back(scan);
    }
  }
  const std::vector<uint32_t> toleranced_targets = FullShares(targets.toleranced.bits).targets;
  std::vector<double> density(toleranced_targets.size(), 0);
  std::vector<uint32_t> open;
  std::vector<size_t> open_at;
  std::vector<float> enough_m;
  for (size_t i = 0; i < toleranced_targets.size(); ++i) {
    const uint32_t t = toleranced_targets[i];
    if (any_measured) {
      density[i] = EquivalentDensity(targets.priors[t], targets.uncertainties.after_all[t].total_m);
    }
    const double needed = targets.toleranced.admissible_density[t];
    if (density[i] >= needed) continue;
    open.push_back(t);
    open_at.push_back(i);
    enough_m.push_back(
        static_cast<float>(UncertaintyAtDensity(targets.priors[t], needed - density[i])));
  }
  if (!open.empty() && !simulated.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto exact,
                               targets.client->Uncertainties(simulated, open, false, enough_m));
    for (size_t k = 0; k < open.size(); ++k) {
      // At "enough" the sum equals the required one exactly, despite rounding.
      density[open_at[k]] +=
          exact.total_m[k] <= enough_m[k]
              ? targets.toleranced.admissible_density[open[k]] - density[open_at[k]]
              : EquivalentDensity(targets.priors[open[k]], exact.total_m[k]);
    }
  }
  Counts counts;
  for (size_t i = 0; i < toleranced_targets.size(); ++i) {
    counts.satisfied += density[i] >= targets.toleranced.admissible_density[toleranced_targets[i]];
    counts.relaxed += density[i] >= targets.toleranced.relaxed_density[toleranced_targets[i]];
  }
  return counts;
}

absl::StatusOr<PlanScore> MeasuredGainModel::ScorePlan(std::span<const Measurement> scans,
                                                       bool thorough) {
  if (!ScoresPlans()) return gain_model_->ScorePlan(scans, thorough);
  PlanScore score;
  SIGHTLINE_ASSIGN_OR_RETURN(auto counts, Count(planned_, scans));
  score.measurable = planned_.toleranced.bits.Count();
  score.satisfied = counts.satisfied;
  score.relaxed = counts.relaxed;
  if (!fresh_) return score;
  SIGHTLINE_ASSIGN_OR_RETURN(auto fresh, Count(*fresh_, scans));
  score.validation_measurable = fresh_->toleranced.bits.Count();
  score.validation_satisfied = fresh.satisfied;
  score.validation_relaxed = fresh.relaxed;
  return score;
}

absl::StatusOr<std::vector<PlanScore>> MeasuredGainModel::ScoreGrowingPlan(
    std::span<const Measurement> scans) {
  if (!ScoresPlans()) return gain_model_->ScoreGrowingPlan(scans);
  std::vector<PlanScore> scores;
  for (size_t count = 1; count <= scans.size(); ++count) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto counts, Count(planned_, scans.first(count)));
    PlanScore& score = scores.emplace_back();
    score.measurable = planned_.toleranced.bits.Count();
    score.satisfied = counts.satisfied;
    score.relaxed = counts.relaxed;
  }
  return scores;
}

absl::StatusOr<PosteriorUncertainties> MeasuredGainModel::Uncertainties(
    std::span<const Measurement> scans) const {
  const size_t target_count = planned_.priors.size(), measured_count = scans_.size();
  std::vector<Measurement> simulated;
  for (const Measurement& scan : scans) {
    if (!MeasuredIndex(scan)) simulated.push_back(scan);
  }
  PosteriorUncertainties result;
  if (!simulated.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(result, planned_.client->Uncertainties(simulated, {}, true, {}));
  } else {
    result.total_m.resize(target_count);
    for (size_t t = 0; t < target_count; ++t) {
      result.total_m[t] = static_cast<float>(planned_.priors[t].standard_deviation_m);
    }
    result.sampling_m = result.total_m;
    result.noise_m.assign(target_count, 0);
    result.calibration_m.assign(target_count, 0);
    result.points.assign(target_count, 0);
  }
  std::vector<float> after_each_m;
  after_each_m.reserve(target_count * scans.size());
  for (size_t t = 0; t < target_count; ++t) {
    const SurfacePrior& prior = planned_.priors[t];
    double by_points = 0, by_simulation = 0;
    size_t simulated_so_far = 0;
    for (const Measurement& scan : scans) {
      if (const auto measured = MeasuredIndex(scan)) {
        by_points = std::max(
            by_points,
            EquivalentDensity(
                prior, planned_.uncertainties.after_each_scan_m[t * measured_count + *measured]));
      } else {
        by_simulation = EquivalentDensity(
            prior, result.after_each_scan_m[t * simulated.size() + simulated_so_far++]);
      }
      after_each_m.push_back(
          static_cast<float>(UncertaintyAtDensity(prior, by_points + by_simulation)));
    }
    const double density = by_points + by_simulation;
    if (!(by_points > 0) || after_each_m.empty()) continue;
    // Split the total in the proportions of points and simulation, each by its
    // density.
    const SurfaceUncertainty& told = planned_.uncertainties.after_all[t];
    const double total_m = after_each_m.back();
    const auto part = [&](double of_points_m, float of_simulation_m) {
      const double points_share = std::pow(of_points_m / told.total_m, 2);
      const double simulation_share = std::pow(of_simulation_m / result.total_m[t], 2);
      return static_cast<float>(
          total_m *
          std::sqrt((by_points * points_share + by_simulation * simulation_share) / density));
    };
    result.noise_m[t] = part(told.noise_m, result.noise_m[t]);
    result.sampling_m[t] = part(told.sampling_m, result.sampling_m[t]);
    result.calibration_m[t] = part(told.calibration_m, result.calibration_m[t]);
    result.total_m[t] = static_cast<float>(total_m);
    result.points[t] += planned_.uncertainties.points[t];
  }
  result.after_each_scan_m = std::move(after_each_m);
  return result;
}

}  // namespace sightline
