// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/pool/exchanges.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "core/cpu/function_clones.h"

namespace sightline {
namespace {

// Number of elements at which sum - out + in reaches the need.
SIGHTLINE_CLONES("avx2")
int64_t CountExchanged(const uint16_t* sum, const uint8_t* out, const uint8_t* in, size_t size) {
  // As in CountReached.
  constexpr size_t kRun = 8192;
  int64_t count = 0;
  for (size_t begin = 0; begin < size; begin += kRun) {
    const size_t end = std::min(size, begin + kRun);
    uint16_t reached = 0;
    for (size_t i = begin; i < end; ++i) {
      const auto with = static_cast<uint16_t>(sum[i] - out[i] + in[i]);
      reached = static_cast<uint16_t>(reached + (with >= kWholeShare));
    }
    count += reached;
  }
  return count;
}

// Number of targets satisfied by `in` or by a scan of the plan other than `out`.
SIGHTLINE_CLONES("popcnt")
int64_t CountSettledWith(const uint64_t* once, const uint64_t* twice, const uint64_t* out,
                         const uint64_t* in, size_t words) {
  int64_t count = 0;
  for (size_t i = 0; i < words; ++i) {
    count += std::popcount((once[i] & (~out[i] | twice[i])) | in[i]);
  }
  return count;
}

// Adds the targets of one more scan to the counts.
SIGHTLINE_CLONES("avx2")
void CountScan(const uint64_t* scan, uint64_t* once, uint64_t* twice, size_t words) {
  for (size_t i = 0; i < words; ++i) {
    twice[i] |= once[i] & scan[i];
    once[i] |= scan[i];
  }
}

}  // namespace

SIGHTLINE_CLONES("avx2")
int64_t CountReached(const uint8_t* need, const uint8_t* added, size_t size) {
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

ShareExchanges::ShareExchanges(const std::vector<ShareStep>& steps, size_t targets,
                               const std::vector<ShareColumn>& columns, PoolPlan plan)
    : steps_(steps),
      targets_(targets),
      columns_(columns),
      plan_(std::move(plan)),
      sum_(steps.size() * targets, 0) {
  for (const size_t scan : plan_) {
    for (size_t i = 0; i < sum_.size(); ++i) {
      sum_[i] = static_cast<uint16_t>(sum_[i] + columns_[scan][i]);
    }
  }
}

double ShareExchanges::WorthWith(size_t place, size_t scan) const {
  const ShareColumn &out = columns_[plan_[place]], &in = columns_[scan];
  double worth = 0;
  for (size_t s = 0; s < steps_.size(); ++s) {
    const size_t begin = s * targets_;
    worth += steps_[s].weight *
             static_cast<double>(CountExchanged(sum_.data() + begin, out.data() + begin,
                                                in.data() + begin, targets_));
  }
  return worth;
}

std::vector<double> ShareExchanges::WorthWithEach(size_t place) const {
  const ShareColumn& out = columns_[plan_[place]];
  ShareColumn need(sum_.size());
  for (size_t i = 0; i < sum_.size(); ++i) {
    need[i] = static_cast<uint8_t>(kWholeShare - std::min<int>(sum_[i] - out[i], kWholeShare));
  }
  std::vector<double> worths;
  worths.reserve(columns_.size());
  for (const ShareColumn& in : columns_) {
    double worth = 0;
    for (size_t s = 0; s < steps_.size(); ++s) {
      const size_t begin = s * targets_;
      worth += steps_[s].weight *
               static_cast<double>(CountReached(need.data() + begin, in.data() + begin, targets_));
    }
    worths.push_back(worth);
  }
  return worths;
}

void ShareExchanges::Exchange(size_t place, size_t scan) {
  const ShareColumn &out = columns_[plan_[place]], &in = columns_[scan];
  for (size_t i = 0; i < sum_.size(); ++i) {
    sum_[i] = static_cast<uint16_t>(sum_[i] - out[i] + in[i]);
  }
  plan_[place] = scan;
}

CoverColumn WholeShares(const ShareColumn& column, size_t steps, size_t targets) {
  const size_t words = (targets + 63) / 64;
  CoverColumn cover(steps * words, 0);
  for (size_t s = 0; s < steps; ++s) {
    for (size_t t = 0; t < targets; ++t) {
      cover[s * words + t / 64] |= uint64_t{column[s * targets + t] == kWholeShare} << (t % 64);
    }
  }
  return cover;
}

CoverExchanges::CoverExchanges(const std::vector<ShareStep>& steps,
                               const std::vector<CoverColumn>& columns, PoolPlan plan)
    : steps_(steps),
      columns_(columns),
      plan_(std::move(plan)),
      once_(columns.front().size()),
      twice_(once_.size()) {
  Count();
}

void CoverExchanges::Count() {
  std::fill(once_.begin(), once_.end(), 0);
  std::fill(twice_.begin(), twice_.end(), 0);
  for (const size_t scan : plan_) {
    CountScan(columns_[scan].data(), once_.data(), twice_.data(), once_.size());
  }
}

double CoverExchanges::WorthWith(size_t place, size_t scan) const {
  const CoverColumn &out = columns_[plan_[place]], &in = columns_[scan];
  const size_t words = once_.size() / steps_.size();
  double worth = 0;
  for (size_t s = 0; s < steps_.size(); ++s) {
    const size_t begin = s * words;
    worth += steps_[s].weight *
             static_cast<double>(CountSettledWith(once_.data() + begin, twice_.data() + begin,
                                                  out.data() + begin, in.data() + begin, words));
  }
  return worth;
}

std::vector<double> CoverExchanges::WorthWithEach(size_t place) const {
  std::vector<double> worths;
  worths.reserve(columns_.size());
  for (size_t scan = 0; scan < columns_.size(); ++scan) worths.push_back(WorthWith(place, scan));
  return worths;
}

void CoverExchanges::Exchange(size_t place, size_t scan) {
  plan_[place] = scan;
  Count();
}

}  // namespace sightline
