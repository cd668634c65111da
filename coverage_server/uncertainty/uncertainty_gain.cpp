// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/uncertainty/uncertainty_gain.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace sightline {

namespace {

// Required densities by uncertainty; cached, because there are few tolerances and many targets.
class NeededDensities {
 public:
  explicit NeededDensities(const TargetPriors& priors) : priors_(priors) {}

  float At(size_t target, float uncertainty_m) {
    if (!(uncertainty_m > 0)) return std::numeric_limits<float>::infinity();
    const std::pair<uint16_t, float> key{priors_.prior_of[target], uncertainty_m};
    if (key == last_key_) return last_;
    const auto known = needed_.find(key);
    last_key_ = key;
    if (known != needed_.end()) return last_ = known->second;
    const SurfacePrior& prior = priors_.priors[key.first];
    last_ = uncertainty_m >= prior.standard_deviation_m
                ? 0.0f
                : static_cast<float>(DensityForUncertainty(prior, uncertainty_m));
    needed_[key] = last_;
    return last_;
  }

 private:
  const TargetPriors& priors_;
  std::map<std::pair<uint16_t, float>, float> needed_;
  std::pair<uint16_t, float> last_key_{0, -1.0f};
  float last_ = 0;
};

}  // namespace

UncertaintyValue::UncertaintyValue(const TargetPriors& priors, const TargetBits& measurable,
                                   const UncertaintyRequirement& requirement)
    : priors_(priors),
      measurable_(measurable),
      weights_(requirement.weights),
      admissible_uncertainty_m_(requirement.admissible_uncertainty_m),
      covered_(requirement.covered) {
  NeededDensities needed(priors);
  targets_.resize(measurable.size());
  for (size_t t = 0; t < targets_.size(); ++t) {
    const float admissible_m =
        admissible_uncertainty_m_[admissible_uncertainty_m_.size() == 1 ? 0 : t];
    Target& target = targets_[t];
    target.known = requirement.known_density.empty() ? 0.0f : requirement.known_density[t];
    target.admissible =
        measurable.Test(t) ? needed.At(t, admissible_m) : std::numeric_limits<float>::infinity();
    target.relaxed = needed.At(t, static_cast<float>(requirement.relaxed_uncertainty_m));
    target.worth = Worth(target, target.known, t);
  }
}

float UncertaintyValue::Unsettled(size_t index, float density) const {
  const SurfacePrior& prior = priors_.of(index);
  const double admissible_m =
      admissible_uncertainty_m_[admissible_uncertainty_m_.size() == 1 ? 0 : index];
  const double u_m =
      density > 0 ? UncertaintyAtDensity(prior, density) : prior.standard_deviation_m;
  const double excess =
      std::max(0.0, u_m - admissible_m) / (prior.standard_deviation_m - admissible_m);
  return static_cast<float>(excess * excess);
}

float UncertaintyValue::Worth(const Target& target, float density, size_t index) const {
  if (!std::isfinite(target.admissible)) return 0;
  float worth = 0;
  if (density >= target.admissible) worth += static_cast<float>(weights_.admissible);
  if (density >= target.relaxed) worth += static_cast<float>(weights_.relaxed);
  if (weights_.information > 0) {
    const float share = target.admissible > 0 ? density / target.admissible : 1.0f;
    worth += static_cast<float>(weights_.information) * std::min(1.0f, share);
  }
  if (weights_.total_uncertainty > 0) {
    worth += static_cast<float>(weights_.total_uncertainty) * (1 - Unsettled(index, density));
  }
  return worth;
}

double UncertaintyValue::Gain(const ScanInformation& scan,
                              const TargetBits& covered_by_scan) const {
  double gain = 0;
  for (size_t i = 0; i < scan.targets.size(); ++i) {
    const size_t t = scan.targets[i];
    const Target& target = targets_[t];
    if (!std::isfinite(target.admissible)) continue;
    gain += Worth(target, target.known + scan.density[i], t) - target.worth;
  }
  if (weights_.coverage > 0) {
    TargetBits fresh = covered_by_scan;
    fresh &= measurable_;
    if (covered_ != nullptr) fresh.Subtract(*covered_);
    gain += weights_.coverage * static_cast<double>(fresh.Count());
  }
  return gain;
}

int32_t UncertaintyValue::NewAdmissible(const ScanInformation& scan) const {
  int32_t count = 0;
  for (size_t i = 0; i < scan.targets.size(); ++i) {
    const Target& target = targets_[scan.targets[i]];
    count += target.known < target.admissible &&
             target.known + scan.density[i] >= target.admissible &&
             std::isfinite(target.admissible);
  }
  return count;
}

double UncertaintyValue::WeightedShare(const ScanInformation& scan,
                                       std::span<const float> target_weights) const {
  double sum = 0;
  for (size_t i = 0; i < scan.targets.size(); ++i) {
    const size_t t = scan.targets[i];
    const Target& target = targets_[t];
    if (!std::isfinite(target.admissible)) continue;
    const float share = target.admissible > 0 ? scan.density[i] / target.admissible : 1.0f;
    sum += double{target_weights[t]} * std::min(1.0f, share);
  }
  return sum;
}

}  // namespace sightline
