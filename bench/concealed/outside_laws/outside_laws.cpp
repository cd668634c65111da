// SPDX-License-Identifier: Apache-2.0
#include "bench/concealed/outside_laws/outside_laws.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>

#include "core/random/counter_random.h"

namespace sightline::bench {
namespace {

// Committed before any law was diagnosed; another value would open sealed laws.
constexpr uint64_t kDivisionSeed = 20261128;

// True for the first half of a random order of the laws.
std::vector<bool> DrawnForDevelopment(size_t count) {
  std::vector<size_t> order(count);
  std::iota(order.begin(), order.end(), size_t{0});
  CounterRandom random(DeriveSeed(kDivisionSeed, "outside laws"), 0);
  for (size_t i = count - 1; i > 0; --i) {
    const auto other = static_cast<size_t>(static_cast<double>(i + 1) * random.Uniform());
    std::swap(order[i], order[std::min(i, other)]);
  }
  std::vector<bool> drawn(count, false);
  for (size_t i = 0; i < count / 2; ++i) drawn[order[i]] = true;
  return drawn;
}

std::vector<OutsideLaw> Half(bool development) {
  const std::vector<OutsideLaw>& laws = OutsideLaws();
  const std::vector<bool> drawn = DrawnForDevelopment(laws.size());
  std::vector<OutsideLaw> half;
  for (size_t i = 0; i < laws.size(); ++i) {
    if (drawn[i] == development) half.push_back(laws[i]);
  }
  return half;
}

}  // namespace

const std::vector<OutsideLaw>& OutsideLaws() {
#define SIGHTLINE_CALL(name) name(),
  static const std::vector<OutsideLaw> laws = {SIGHTLINE_OUTSIDE_LAWS(SIGHTLINE_CALL)};
#undef SIGHTLINE_CALL
  return laws;
}

std::vector<OutsideLaw> DevelopmentLaws() { return Half(true); }

std::vector<OutsideLaw> SealedLaws() { return Half(false); }

const OutsideLaw* FindOutsideLaw(std::string_view id) {
  for (const OutsideLaw& law : OutsideLaws()) {
    if (law.effect->description().id == id) return &law;
  }
  return nullptr;
}

}  // namespace sightline::bench
