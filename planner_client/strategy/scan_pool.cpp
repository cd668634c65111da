#include "planner_client/strategy/scan_pool.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

constexpr uint8_t kWhole = 127;  // two of them still fit into a byte
constexpr double kBetter = 1e-9;
// Temperatures of annealing, in parts of what all is worth: one exchange in three that loses this
// much is accepted.
constexpr double kHottest = 0.005, kColdest = 0.0001;

// Number of places at which `added` reaches `need`.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(SIGHTLINE_NO_TARGET_CLONES)
__attribute__((target_clones("avx2", "default")))
#endif
int64_t
CountReached(const uint8_t* need, const uint8_t* added, size_t size) {
  // Counts of up to 128 fit into a byte, which keeps all lanes of a vector busy.
  constexpr size_t kRun = 128;
  int64_t count = 0;
  size_t i = 0;
  for (; i + kRun <= size; i += kRun) {
    uint8_t reached = 0;
    for (size_t k = 0; k < kRun; ++k) {
      reached = static_cast<uint8_t>(reached + (added[i + k] >= need[i + k]));
    }
    count += reached;
  }
  for (; i < size; ++i) count += added[i] >= need[i];
  return count;
}

// What every place still needs without `out`, of which `sum` has a part.
void NeedWithout(const std::vector<uint16_t>& sum, const std::vector<uint8_t>& out,
                 std::vector<uint8_t>& need) {
  for (size_t i = 0; i < sum.size(); ++i) {
    const auto others = static_cast<uint16_t>(sum[i] - out[i]);
    need[i] = static_cast<uint8_t>(kWhole - std::min<uint16_t>(others, kWhole));
  }
}

void AddSaturated(const std::vector<uint8_t>& added, std::vector<uint8_t>& sum) {
  for (size_t i = 0; i < sum.size(); ++i) {
    sum[i] = static_cast<uint8_t>(std::min<int>(kWhole, sum[i] + added[i]));
  }
}

}  // namespace

std::vector<uint32_t> TargetSample(const TargetBits& judged, size_t steps, size_t pairs,
                                   Random& random) {
  const size_t size = pairs / std::max<size_t>(1, steps);
  std::vector<uint32_t> sample = FullShares(judged).targets;
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
      // What does not reach the step by itself must not do so by rounding.
      column[s * targets_.size() + place] =
          part >= 1
              ? kWhole
              : std::min<uint8_t>(kWhole - 1, static_cast<uint8_t>(std::lround(kWhole * part)));
    }
  }
  columns_.push_back(std::move(column));
  return columns_.size() - 1;
}

void ScanPool::Empty(size_t scan) { std::fill(columns_[scan].begin(), columns_[scan].end(), 0); }

void ScanPool::Keep(const std::vector<size_t>& kept) {
  std::vector<Column> columns;
  for (const size_t scan : kept) columns.push_back(std::move(columns_[scan]));
  columns_ = std::move(columns);
}

ScanPool::Column ScanPool::NeedAfter(const PoolPlan& plan) const {
  Column sum(steps_.size() * targets_.size(), 0);
  for (const size_t scan : plan) AddSaturated(columns_[scan], sum);
  for (uint8_t& entry : sum) entry = static_cast<uint8_t>(kWhole - entry);
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

double ScanPool::Worth(const PoolPlan& plan) const {
  return WorthWith(NeedAfter(plan), Column(steps_.size() * targets_.size(), 0));
}

std::vector<double> ScanPool::WorthWithEach(const PoolPlan& plan) const {
  const Column need = NeedAfter(plan);
  std::vector<double> worth;
  worth.reserve(columns_.size());
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
  double worth = Worth(plan);
  while (true) {
    std::vector<Column> need;
    for (size_t place = fixed; place < plan.size(); ++place) {
      PoolPlan others = plan;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(place));
      need.push_back(NeedAfter(others));
    }
    double best_worth = worth;
    size_t best_place = 0, best_scan = 0;
    for (size_t scan = 0; scan < columns_.size(); ++scan) {
      for (size_t k = 0; k < need.size(); ++k) {
        const double with = WorthWith(need[k], columns_[scan]);
        if (with > best_worth + kBetter) {
          best_worth = with;
          best_place = fixed + k;
          best_scan = scan;
        }
      }
    }
    if (best_worth <= worth + kBetter) return;
    plan[best_place] = best_scan;
    worth = best_worth;
  }
}

PoolPlan ScanPool::Anneal(PoolPlan plan, size_t fixed, double goal, int64_t proposals,
                          Random& random, const std::function<bool()>& stop) const {
  const size_t size = plan.size();
  if (size <= fixed || columns_.empty()) return plan;
  // Not saturated, so that scans can be taken out again.
  std::vector<uint16_t> sum(steps_.size() * targets_.size(), 0);
  for (const size_t scan : plan) {
    for (size_t i = 0; i < sum.size(); ++i) {
      sum[i] = static_cast<uint16_t>(sum[i] + columns_[scan][i]);
    }
  }
  // What is needed without the scan at each place. Most proposals are refused, so it is made anew
  // only where it is asked for after the plan has changed.
  std::vector<Column> need(size, Column(sum.size()));
  std::vector<bool> known(size, false);
  const auto worth_with = [&](size_t place, size_t in) {
    if (!known[place]) NeedWithout(sum, columns_[plan[place]], need[place]);
    known[place] = true;
    return WorthWith(need[place], columns_[in]);
  };
  double worth = worth_with(fixed, plan[fixed]);
  PoolPlan best = plan;
  double best_worth = worth;
  double temperature = kHottest * MostWorth();
  const double cooling = std::pow(kColdest / kHottest, 1.0 / static_cast<double>(proposals));
  for (int64_t proposal = 0; proposal < proposals && best_worth < goal - kBetter; ++proposal) {
    if (proposal % 1024 == 0 && stop()) break;
    const size_t place =
        fixed + static_cast<size_t>(random.Below(static_cast<int64_t>(size - fixed)));
    const auto in = static_cast<size_t>(random.Below(static_cast<int64_t>(columns_.size())));
    const double with = worth_with(place, in);
    temperature *= cooling;
    if (with < worth && random.Uniform() >= std::exp((with - worth) / temperature)) continue;
    if (in != plan[place]) {
      const Column &out = columns_[plan[place]], &instead = columns_[in];
      for (size_t i = 0; i < sum.size(); ++i) {
        sum[i] = static_cast<uint16_t>(sum[i] - out[i] + instead[i]);
      }
      known.assign(size, false);
    }
    plan[place] = in;
    worth = with;
    if (worth > best_worth) {
      best_worth = worth;
      best = plan;
    }
  }
  ExchangeWhileBetter(best, fixed);
  return best;
}

}  // namespace sightline
