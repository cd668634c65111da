// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/pool/scan_pool.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "core/cpu/function_clones.h"

namespace sightline {
namespace {

constexpr double kBetter = 1e-9;
// Temperatures of annealing as fractions of the largest worth. An exchange that loses this much is
// accepted with probability 1/e.
constexpr double kHottest = 0.005, kColdest = 0.0001;

SIGHTLINE_CLONES("popcnt")
int64_t CountInEither(const uint64_t* a, const uint64_t* b, size_t words) {
  int64_t count = 0;
  for (size_t i = 0; i < words; ++i) count += std::popcount(a[i] | b[i]);
  return count;
}

void AddSaturated(const std::vector<uint8_t>& added, std::vector<uint8_t>& sum) {
  for (size_t i = 0; i < sum.size(); ++i) {
    sum[i] = static_cast<uint8_t>(std::min<int>(kWholeShare, sum[i] + added[i]));
  }
}

// Repeats the best replacement of a plan's scan, from position `fixed` on, by one of the pool as
// long as that raises the worth. Exchanges: interface of ShareExchanges.
template <typename Exchanges>
PoolPlan ExchangedWhileBetter(Exchanges exchanges, size_t fixed) {
  if (exchanges.plan().size() <= fixed) return exchanges.plan();
  double worth = exchanges.WorthWith(fixed, exchanges.plan()[fixed]);
  while (true) {
    double best_worth = worth;
    size_t best_place = 0, best_scan = 0;
    for (size_t place = fixed; place < exchanges.plan().size(); ++place) {
      const std::vector<double> with = exchanges.WorthWithEach(place);
      for (size_t scan = 0; scan < with.size(); ++scan) {
        if (with[scan] <= best_worth + kBetter) continue;
        best_worth = with[scan];
        best_place = place;
        best_scan = scan;
      }
    }
    if (best_worth <= worth + kBetter) return exchanges.plan();
    exchanges.Exchange(best_place, best_scan);
    worth = best_worth;
  }
}

template <typename Exchanges>
PoolPlan Annealed(Exchanges exchanges, size_t scans, size_t fixed, double goal, double most_worth,
                  int64_t proposals, Random& random, const std::function<bool()>& stop) {
  const size_t size = exchanges.plan().size();
  double worth = exchanges.WorthWith(fixed, exchanges.plan()[fixed]);
  PoolPlan best = exchanges.plan();
  double best_worth = worth;
  double temperature = kHottest * most_worth;
  const double cooling = std::pow(kColdest / kHottest, 1.0 / static_cast<double>(proposals));
  for (int64_t proposal = 0; proposal < proposals && best_worth < goal - kBetter; ++proposal) {
    if (proposal % 1024 == 0 && stop()) break;
    const size_t place =
        fixed + static_cast<size_t>(random.Below(static_cast<int64_t>(size - fixed)));
    const auto in = static_cast<size_t>(random.Below(static_cast<int64_t>(scans)));
    const double with = exchanges.WorthWith(place, in);
    temperature *= cooling;
    if (with < worth && random.Uniform() >= std::exp((with - worth) / temperature)) continue;
    exchanges.Exchange(place, in);
    worth = with;
    if (worth > best_worth) {
      best_worth = worth;
      best = exchanges.plan();
    }
  }
  return best;
}

}  // namespace

std::vector<uint32_t> TargetSample(const TargetBits& measurable, size_t steps, size_t pairs,
                                   Random& random) {
  const size_t size = pairs / std::max<size_t>(1, steps);
  std::vector<uint32_t> sample = FullShares(measurable).targets;
  if (sample.size() <= size * 5 / 4) return sample;
  for (size_t i = 0; i < size; ++i) {
    const auto left = static_cast<int64_t>(sample.size() - i);
    std::swap(sample[i], sample[i + static_cast<size_t>(random.Below(left))]);
  }
  sample.resize(size);
  std::sort(sample.begin(), sample.end());
  return sample;
}

ScanPool::ScanPool(std::vector<ShareStep> steps, std::vector<uint32_t> targets)
    : steps_(std::move(steps)), targets_(std::move(targets)) {}

size_t ScanPool::Add(const TargetShares& shares) {
  Column column(steps_.size() * targets_.size(), 0);
  size_t place = 0;
  for (size_t i = 0; i < shares.targets.size(); ++i) {
    while (place < targets_.size() && targets_[place] < shares.targets[i]) ++place;
    if (place == targets_.size()) break;
    if (targets_[place] != shares.targets[i]) continue;
    for (size_t s = 0; s < steps_.size(); ++s) {
      const float part = shares.share[i] / steps_[s].of(targets_[place]);
      only_whole_ = only_whole_ && part >= 1;
      // Rounding must not lift a fraction below the threshold to the whole.
      column[s * targets_.size() + place] =
          part >= 1 ? kWholeShare
                    : std::min<uint8_t>(kWholeShare - 1,
                                        static_cast<uint8_t>(std::lround(kWholeShare * part)));
    }
  }
  covers_.push_back(WholeShares(column, steps_.size(), targets_.size()));
  columns_.push_back(std::move(column));
  return columns_.size() - 1;
}

void ScanPool::Empty(size_t scan) {
  std::fill(columns_[scan].begin(), columns_[scan].end(), 0);
  std::fill(covers_[scan].begin(), covers_[scan].end(), 0);
}

void ScanPool::Keep(const std::vector<size_t>& kept) {
  std::vector<Column> columns;
  std::vector<CoverColumn> covers;
  for (const size_t scan : kept) {
    columns.push_back(std::move(columns_[scan]));
    covers.push_back(std::move(covers_[scan]));
  }
  columns_ = std::move(columns);
  covers_ = std::move(covers);
}

ScanPool::Column ScanPool::NeedAfter(const PoolPlan& plan) const {
  Column sum(steps_.size() * targets_.size(), 0);
  for (const size_t scan : plan) AddSaturated(columns_[scan], sum);
  for (uint8_t& entry : sum) entry = static_cast<uint8_t>(kWholeShare - entry);
  return sum;
}

double ScanPool::WorthWith(const Column& need, const Column& added) const {
  double worth = 0;
  for (size_t s = 0; s < steps_.size(); ++s) {
    const size_t begin = s * targets_.size();
    worth += steps_[s].weight * static_cast<double>(CountReached(
                                    need.data() + begin, added.data() + begin, targets_.size()));
  }
  return worth;
}

CoverColumn ScanPool::CoveredBy(const PoolPlan& plan) const {
  CoverColumn once(covers_.empty() ? 0 : covers_.front().size(), 0);
  for (const size_t scan : plan) {
    for (size_t w = 0; w < once.size(); ++w) once[w] |= covers_[scan][w];
  }
  return once;
}

double ScanPool::WorthOf(const CoverColumn& once, const CoverColumn& also) const {
  const size_t words = once.size() / std::max<size_t>(1, steps_.size());
  double worth = 0;
  for (size_t s = 0; s < steps_.size(); ++s) {
    worth += steps_[s].weight * static_cast<double>(CountInEither(once.data() + s * words,
                                                                  also.data() + s * words, words));
  }
  return worth;
}

double ScanPool::Worth(const PoolPlan& plan) const {
  if (only_whole_) {
    const CoverColumn once = CoveredBy(plan);
    return WorthOf(once, once);
  }
  return WorthWith(NeedAfter(plan), Column(steps_.size() * targets_.size(), 0));
}

std::vector<double> ScanPool::WorthWithEach(const PoolPlan& plan) const {
  std::vector<double> worth;
  worth.reserve(columns_.size());
  if (only_whole_) {
    const CoverColumn once = CoveredBy(plan);
    for (const CoverColumn& cover : covers_) worth.push_back(WorthOf(once, cover));
    return worth;
  }
  const Column need = NeedAfter(plan);
  for (const Column& column : columns_) worth.push_back(WorthWith(need, column));
  return worth;
}

double ScanPool::MostWorth() const {
  double worth = 0;
  for (const ShareStep& step : steps_) {
    worth += step.weight * static_cast<double>(targets_.size());
  }
  return worth;
}

std::vector<double> ScanPool::Promise(const PoolPlan& plan) const {
  const double now = Worth(plan);
  const Column need = NeedAfter(plan);
  std::vector<double> promise(columns_.size()), exchange(columns_.size(), -MostWorth());
  for (size_t scan = 0; scan < columns_.size(); ++scan) {
    promise[scan] = WorthWith(need, columns_[scan]) - now;
  }
  for (size_t place = 0; place < plan.size(); ++place) {
    PoolPlan others = plan;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(place));
    const Column without = NeedAfter(others);
    for (size_t scan = 0; scan < columns_.size(); ++scan) {
      exchange[scan] = std::max(exchange[scan], WorthWith(without, columns_[scan]) - now);
    }
  }
  for (size_t scan = 0; scan < columns_.size(); ++scan) promise[scan] += exchange[scan];
  return promise;
}

void ScanPool::CompleteGreedily(PoolPlan& plan, size_t size, double goal) const {
  double worth = Worth(plan);
  while (plan.size() < size && worth < goal - kBetter) {
    const Column need = NeedAfter(plan);
    double best_worth = worth;
    size_t best = columns_.size();
    for (size_t scan = 0; scan < columns_.size(); ++scan) {
      const double with = WorthWith(need, columns_[scan]);
      if (with > best_worth + kBetter) {
        best_worth = with;
        best = scan;
      }
    }
    if (best == columns_.size()) return;
    plan.push_back(best);
    worth = best_worth;
  }
}

void ScanPool::ExchangeWhileBetter(PoolPlan& plan, size_t fixed) const {
  plan = only_whole_
             ? ExchangedWhileBetter(CoverExchanges(steps_, covers_, plan), fixed)
             : ExchangedWhileBetter(ShareExchanges(steps_, targets_.size(), columns_, plan), fixed);
}

PoolPlan ScanPool::Anneal(PoolPlan plan, size_t fixed, double goal, int64_t proposals,
                          Random& random, const std::function<bool()>& stop) const {
  if (plan.size() <= fixed || columns_.empty()) return plan;
  const auto annealed = [&](auto exchanges) {
    return Annealed(std::move(exchanges), columns_.size(), fixed, goal, MostWorth(), proposals,
                    random, stop);
  };
  PoolPlan best =
      only_whole_ ? annealed(CoverExchanges(steps_, covers_, std::move(plan)))
                  : annealed(ShareExchanges(steps_, targets_.size(), columns_, std::move(plan)));
  ExchangeWhileBetter(best, fixed);
  return best;
}

}  // namespace sightline
