// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/target_shares.h"

#include <bit>

namespace sightline {

TargetShares FullShares(const TargetBits& satisfied) {
  TargetShares shares;
  for (size_t w = 0; w < satisfied.words().size(); ++w) {
    for (uint64_t word = satisfied.words()[w]; word != 0; word &= word - 1) {
      shares.targets.push_back(static_cast<uint32_t>(64 * w + std::countr_zero(word)));
    }
  }
  shares.share.assign(shares.targets.size(), 1.0f);
  return shares;
}

void AddShares(const TargetShares& scan, std::span<float> known) {
  for (size_t i = 0; i < scan.targets.size(); ++i) known[scan.targets[i]] += scan.share[i];
}

TargetBits Satisfied(const TargetBits& measurable, std::span<const float> known) {
  TargetBits satisfied(measurable.size());
  for (size_t t = 0; t < known.size(); ++t) {
    if (known[t] >= 1) satisfied.Set(t);
  }
  satisfied &= measurable;
  return satisfied;
}

double StepWorth(std::span<const ShareStep> steps, const TargetBits& measurable,
                 std::span<const float> known) {
  double worth = 0;
  for (size_t t = 0; t < known.size(); ++t) {
    if (!measurable.Test(t)) continue;
    for (const ShareStep& step : steps) {
      if (known[t] >= step.of(t)) worth += step.weight;
    }
  }
  return worth;
}

double StepGain(std::span<const ShareStep> steps, const TargetBits& measurable,
                std::span<const float> known, const TargetShares& scan) {
  double gain = 0;
  for (size_t i = 0; i < scan.targets.size(); ++i) {
    const size_t t = scan.targets[i];
    if (!measurable.Test(t)) continue;
    for (const ShareStep& step : steps) {
      const float threshold = step.of(t);
      if (known[t] < threshold && known[t] + scan.share[i] >= threshold) gain += step.weight;
    }
  }
  return gain;
}

}  // namespace sightline
