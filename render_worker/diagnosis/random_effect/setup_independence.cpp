// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/setup_independence.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "core/random/counter_random.h"
#include "render_worker/diagnosis/fit/fit_quality.h"

namespace sightline {

namespace {

constexpr int kPermutations = 20000;
constexpr size_t kLeastPositions = 6;

struct Position {
  double sum = 0;
  int recordings = 0;
  std::vector<std::optional<double>> quantities;  // empty: recordings of the position differ
};

std::vector<double> QuantitiesOf(const FrameSetup& frame) {
  return {frame.exposure_time_s,         frame.lens.f_number,
          frame.plate.camera_distance_m, frame.lens.focus_distance_m.value_or(0),
          frame.plate.laser_distance_m,  frame.plate.line_offset_m};
}

// Ranks from 1 on; equal values get the mean of their ranks.
std::vector<double> Ranks(const std::vector<double>& values) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return values[a] < values[b]; });
  std::vector<double> ranks(values.size());
  for (size_t i = 0; i < order.size();) {
    size_t end = i;
    while (end < order.size() && values[order[end]] == values[order[i]]) ++end;
    for (size_t k = i; k < end; ++k) {
      ranks[order[k]] = 0.5 * static_cast<double>(i + end + 1);
    }
    i = end;
  }
  return ranks;
}

// Indices of the positions, grouped by the value of one quantity. A group of a single position is
// joined with the next one, since one realised value is uninformative about its mean.
std::vector<std::vector<size_t>> Levels(const std::vector<Position>& positions, size_t quantity) {
  std::map<double, std::vector<size_t>> by_value;
  for (size_t p = 0; p < positions.size(); ++p) {
    if (positions[p].quantities[quantity]) {
      by_value[*positions[p].quantities[quantity]].push_back(p);
    }
  }
  std::vector<std::vector<size_t>> levels;
  for (auto& [value, members] : by_value) {
    const bool alone = members.size() == 1 || (!levels.empty() && levels.back().size() == 1);
    if (alone && !levels.empty()) {
      levels.back().insert(levels.back().end(), members.begin(), members.end());
    } else {
      levels.push_back(std::move(members));
    }
  }
  if (levels.size() > 1 && levels.back().size() == 1) {
    levels[levels.size() - 2].push_back(levels.back().front());
    levels.pop_back();
  }
  return levels;
}

// P-value of H by its asymptotic chi squared distribution.
double KruskalWallisPValue(const std::vector<std::vector<size_t>>& levels,
                           const std::vector<double>& ranks) {
  double n = 0, total = 0;
  for (const auto& level : levels) {
    for (const size_t p : level) {
      total += ranks[p];
      ++n;
    }
  }
  const double mean = total / n;
  double between = 0, all = 0;
  for (const auto& level : levels) {
    double sum = 0;
    for (const size_t p : level) {
      sum += ranks[p] - mean;
      all += (ranks[p] - mean) * (ranks[p] - mean);
    }
    between += sum * sum / static_cast<double>(level.size());
  }
  if (all <= 0) return 1;
  return ChiSquaredPValue((n - 1) * between / all, static_cast<double>(levels.size()) - 1);
}

}  // namespace

double SetupIndependencePValue(const RecordedSet& set, std::span<const double> drawn,
                               uint64_t seed) {
  assert(drawn.size() == set.frames.size());
  std::map<int, Position> by_id;
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const RecordedFrame& frame = set.frames[f];
    if (frame.plate_position_id < 0 || !frame.nominal.laser_on) continue;
    Position& position = by_id[frame.plate_position_id];
    const std::vector<double> quantities = QuantitiesOf(frame.nominal);
    if (position.recordings == 0) {
      position.quantities.assign(quantities.begin(), quantities.end());
    }
    for (size_t q = 0; q < quantities.size(); ++q) {
      if (position.quantities[q] != quantities[q]) position.quantities[q].reset();
    }
    position.sum += drawn[f];
    ++position.recordings;
  }
  std::vector<Position> positions;
  std::vector<double> values;
  for (auto& [id, position] : by_id) {
    values.push_back(position.sum / position.recordings);
    positions.push_back(std::move(position));
  }
  if (positions.size() < kLeastPositions) return 1;
  std::vector<std::vector<std::vector<size_t>>> quantities;
  for (size_t q = 0; q < positions.front().quantities.size(); ++q) {
    std::vector<std::vector<size_t>> levels = Levels(positions, q);
    if (levels.size() > 1) quantities.push_back(std::move(levels));
  }
  if (quantities.empty()) return 1;
  const auto least = [&](const std::vector<double>& ranks) {
    double p_value = 1;
    for (const auto& levels : quantities) {
      p_value = std::min(p_value, KruskalWallisPValue(levels, ranks));
    }
    return p_value;
  };
  std::vector<double> ranks = Ranks(values);
  const double seen = least(ranks);
  CounterRandom random(DeriveSeed(seed, "set-up independence"), 0);
  int as_strong = 1;  // the observed order itself
  for (int k = 0; k < kPermutations; ++k) {
    for (size_t i = ranks.size(); i > 1; --i) {
      const auto j = static_cast<size_t>(random.Uniform() * static_cast<double>(i));
      std::swap(ranks[i - 1], ranks[std::min(j, i - 1)]);
    }
    as_strong += least(ranks) <= seen * (1 + 1e-9);
  }
  return static_cast<double>(as_strong) / (kPermutations + 1);
}

}  // namespace sightline
