// SPDX-License-Identifier: Apache-2.0
#include "planner_client/gain_model/uncertainty_gain_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/status/status_macros.h"
#include "core/surface_inference/surface_inference.h"

namespace sightline {
namespace {

constexpr float kNever = std::numeric_limits<float>::infinity();
// Exact scores that are not thorough evaluate every n-th toleranced target.
constexpr size_t kStride = 3;
// A search over a pool of scans approximates the worth of information by this many steps.
constexpr int kInformationSteps = 3;
constexpr int kTotalUncertaintySteps = 4;

}  // namespace

TolerancedTargets FindTolerancedTargets(const CoverageClient& client, const UncertaintyModel& model,
                                        const TargetSampling& sampling,
                                        std::vector<float> admissible_uncertainty_m,
                                        double relaxed_uncertainty_m) {
  TolerancedTargets targets;
  const size_t count = client.targets().size();
  targets.bits = TargetBits(count);
  targets.admissible_density.assign(count, kNever);
  targets.relaxed_density.assign(count, kNever);
  targets.admissible_uncertainty_m = std::move(admissible_uncertainty_m);
  // Few different pairs of region and tolerance.
  std::map<std::pair<int32_t, float>, std::pair<float, float>> known;
  for (size_t t = 0; t < count; ++t) {
    const float admissible_m = targets.admissible_uncertainty_m[t];
    if (!client.measurable().Test(t) || !(admissible_m > 0)) {
      targets.admissible_uncertainty_m[t] = 0;
      continue;
    }
    targets.bits.Set(t);
    const int32_t region = client.targets().regions[t];
    auto [entry, fresh] = known.try_emplace({region, admissible_m});
    if (fresh) {
      const double resolution_m =
          region < 0 ? model.resolution_m
                     : sampling.regions[static_cast<size_t>(region)].resolution_m.value_or(
                           model.resolution_m);
      const SurfacePrior prior{model.prior_standard_deviation_m,
                               CovarianceLengthScale(resolution_m)};
      const auto needed = [&](double uncertainty_m) {
        return uncertainty_m >= prior.standard_deviation_m
                   ? std::numeric_limits<float>::min()
                   : static_cast<float>(DensityForUncertainty(prior, uncertainty_m));
      };
      entry->second = {needed(admissible_m),
                       needed(std::max<double>(relaxed_uncertainty_m, admissible_m))};
    }
    targets.admissible_density[t] = entry->second.first;
    targets.relaxed_density[t] = entry->second.second;
  }
  return targets;
}

UncertaintyGainModel::UncertaintyGainModel(Sampling planned, Sampling fresh,
                                           const UncertaintyModel& model,
                                           const GainWeights& weights, double relaxed_uncertainty_m)
    : planned_(std::move(planned)),
      fresh_(std::move(fresh)),
      query_{weights, planned_.targets.admissible_uncertainty_m, relaxed_uncertainty_m, {}},
      prior_standard_deviation_m_(model.prior_standard_deviation_m) {}

absl::StatusOr<std::vector<ScanGain>> UncertaintyGainModel::Gains(
    std::span<const Measurement> measurements, std::span<const float> known) {
  std::vector<float> density(known.size(), 0);
  for (size_t t = 0; t < known.size(); ++t) {
    if (known[t] > 0) density[t] = known[t] * planned_.targets.admissible_density[t];
  }
  UncertaintyQuery query = query_;
  if (query.weights.coverage > 0) {
    // A target with any information counts as covered.
    query.covered = TargetBits(known.size());
    for (size_t t = 0; t < known.size(); ++t) {
      if (known[t] > 0) query.covered.Set(t);
    }
  }
  return planned_.client->UncertaintyGains(measurements, query, density, {});
}

absl::StatusOr<std::vector<ScanGain>> UncertaintyGainModel::WeightedGains(
    std::span<const Measurement> measurements, std::span<const float> weights) {
  return planned_.client->UncertaintyGains(measurements, query_, {}, weights);
}

absl::StatusOr<std::vector<ScanCoverage>> UncertaintyGainModel::FastCoverage(
    std::span<const Measurement> measurements) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto information, planned_.client->FastInformation(measurements));
  std::vector<ScanCoverage> result;
  result.reserve(information.size());
  for (InformedScan& scan : information) {
    ScanCoverage& coverage = result.emplace_back();
    coverage.feasibility = scan.feasibility;
    coverage.covered = std::move(scan.covered);
    for (size_t i = 0; i < scan.targets.size(); ++i) {
      const uint32_t t = scan.targets[i];
      if (!planned_.targets.bits.Test(t)) continue;
      coverage.shares.targets.push_back(t);
      coverage.shares.share.push_back(scan.density[i] / planned_.targets.admissible_density[t]);
    }
  }
  return result;
}

absl::StatusOr<std::vector<ScanCoverage>> UncertaintyGainModel::ExactCoverage(
    std::span<const Measurement> measurements) {
  return planned_.client->ExactCoverage(measurements);
}

std::vector<ShareStep> UncertaintyGainModel::steps() const {
  const GainWeights& w = query_.weights;
  std::vector<ShareStep> steps;
  // Weight of the step that satisfies a target: admissibility and the last step of information.
  const double satisfied = w.admissible + w.information / kInformationSteps;
  if (satisfied > 0) steps.push_back({satisfied, {1.0f}});
  for (int k = 1; k < kInformationSteps && w.information > 0; ++k) {
    steps.push_back({w.information / kInformationSteps,
                     {static_cast<float>(k) / static_cast<float>(kInformationSteps)}});
  }
  if (w.coverage > 0) steps.push_back({w.coverage, {std::numeric_limits<float>::min()}});
  const size_t count = planned_.targets.admissible_density.size();
  if (w.relaxed > 0) {
    ShareStep step{w.relaxed, std::vector<float>(count, 1)};
    for (size_t t = 0; t < count; ++t) {
      if (planned_.targets.bits.Test(t)) {
        step.threshold[t] =
            planned_.targets.relaxed_density[t] / planned_.targets.admissible_density[t];
      }
    }
    steps.push_back(std::move(step));
  }
  // The penalty is the square of the uncertainty's excess over the admissible one. These steps
  // divide it equally.
  for (int k = 0; k < kTotalUncertaintySteps && w.total_uncertainty > 0; ++k) {
    const double rest = std::sqrt(1 - (k + 0.5) / kTotalUncertaintySteps);
    ShareStep step{w.total_uncertainty / kTotalUncertaintySteps, std::vector<float>(count, 1)};
    std::map<float, float> known;
    for (size_t t = 0; t < count; ++t) {
      if (!planned_.targets.bits.Test(t)) continue;
      const float needed = planned_.targets.admissible_density[t];
      auto [entry, fresh] = known.try_emplace(needed);
      if (fresh) {
        const double admissible_m = planned_.targets.admissible_uncertainty_m[t];
        const double u_m = admissible_m + rest * (prior_standard_deviation_m_ - admissible_m);
        // Uncertainty falls nearly with the root of the density; near the prior the exact relation
        // matters little.
        entry->second = static_cast<float>(
            std::min(1.0, std::pow(admissible_m / std::max(u_m, admissible_m), 2)));
      }
      step.threshold[t] = entry->second;
    }
    steps.push_back(std::move(step));
  }
  if (steps.empty()) steps.push_back({1.0, {1.0f}});
  return steps;
}

absl::StatusOr<UncertaintyGainModel::Counts> UncertaintyGainModel::Count(
    const Sampling& sampling, std::span<const Measurement> scans, bool thorough) const {
  std::vector<uint32_t> toleranced = FullShares(sampling.targets.bits).targets;
  Counts counts;
  if (toleranced.empty() || scans.empty()) return counts;
  std::vector<uint32_t> asked;
  for (size_t i = 0; i < toleranced.size(); i += thorough ? 1 : kStride)
    asked.push_back(toleranced[i]);
  std::vector<float> enough_m;
  for (const uint32_t t : asked) enough_m.push_back(sampling.targets.admissible_uncertainty_m[t]);
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact,
                             sampling.client->Uncertainties(scans, asked, false, enough_m));
  for (size_t i = 0; i < asked.size(); ++i) {
    const float u_m = exact.total_m[i];
    counts.satisfied += u_m <= sampling.targets.admissible_uncertainty_m[asked[i]];
    counts.relaxed += u_m <= std::max(sampling.targets.admissible_uncertainty_m[asked[i]],
                                      static_cast<float>(query_.relaxed_uncertainty_m));
  }
  if (thorough) return counts;
  // Extrapolate exact minus fast from the sampled subset to all targets and subtract one standard
  // error: a search prefers plans that scored well by chance.
  SIGHTLINE_ASSIGN_OR_RETURN(auto fast, sampling.client->FastInformation(scans));
  std::vector<float> density(sampling.targets.admissible_density.size(), 0);
  for (const InformedScan& scan : fast) {
    for (size_t i = 0; i < scan.targets.size(); ++i) density[scan.targets[i]] += scan.density[i];
  }
  int64_t differ = 0;  // targets that only one of the two calls admissible
  for (size_t i = 0; i < asked.size(); ++i) {
    differ += (exact.total_m[i] <= sampling.targets.admissible_uncertainty_m[asked[i]]) !=
              (density[asked[i]] >= sampling.targets.admissible_density[asked[i]]);
  }
  const auto scaled = [&](int64_t exact_part, const std::vector<float>& needed) {
    int64_t fast_part = 0, fast_all = 0;
    for (const uint32_t t : asked) fast_part += density[t] >= needed[t];
    for (const uint32_t t : toleranced) fast_all += density[t] >= needed[t];
    const double scale = static_cast<double>(toleranced.size()) / static_cast<double>(asked.size());
    const double error =
        scale *
        std::sqrt(static_cast<double>(differ) *
                  (1 - static_cast<double>(asked.size()) / static_cast<double>(toleranced.size())));
    return std::clamp<int64_t>(
        fast_all + std::llround(scale * static_cast<double>(exact_part - fast_part) - error), 0,
        static_cast<int64_t>(toleranced.size()));
  };
  counts.satisfied = scaled(counts.satisfied, sampling.targets.admissible_density);
  counts.relaxed = scaled(counts.relaxed, sampling.targets.relaxed_density);
  return counts;
}

absl::StatusOr<PlanScore> UncertaintyGainModel::ScorePlan(std::span<const Measurement> scans,
                                                          bool thorough) {
  PlanScore score;
  SIGHTLINE_ASSIGN_OR_RETURN(auto counts, Count(planned_, scans, thorough));
  score.measurable = planned_.targets.bits.Count();
  score.satisfied = counts.satisfied;
  score.relaxed = counts.relaxed;
  if (fresh_.client == nullptr) return score;
  SIGHTLINE_ASSIGN_OR_RETURN(auto fresh, Count(fresh_, scans, thorough));
  score.validation_measurable = fresh_.targets.bits.Count();
  score.validation_satisfied = fresh.satisfied;
  score.validation_relaxed = fresh.relaxed;
  return score;
}

absl::StatusOr<std::vector<PlanScore>> UncertaintyGainModel::ScoreGrowingPlan(
    std::span<const Measurement> scans) {
  const std::vector<uint32_t> toleranced = FullShares(planned_.targets.bits).targets;
  std::vector<PlanScore> scores(scans.size());
  for (PlanScore& score : scores) score.measurable = static_cast<int64_t>(toleranced.size());
  if (toleranced.empty() || scans.empty()) return scores;
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact,
                             planned_.client->Uncertainties(scans, toleranced, true, {}));
  for (size_t i = 0; i < toleranced.size(); ++i) {
    const float admissible_m = planned_.targets.admissible_uncertainty_m[toleranced[i]];
    const float relaxed_m =
        std::max(admissible_m, static_cast<float>(query_.relaxed_uncertainty_m));
    for (size_t s = 0; s < scans.size(); ++s) {
      const float u_m = exact.after_each_scan_m[i * scans.size() + s];
      scores[s].satisfied += u_m <= admissible_m;
      scores[s].relaxed += u_m <= relaxed_m;
    }
  }
  return scores;
}

}  // namespace sightline
