// SPDX-License-Identifier: Apache-2.0
#include "core/laser_line/line_quality.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <tuple>

namespace sightline {
namespace {

// A detected point and a crossing in the same column.
struct CandidateMatch {
  double distance_px;
  size_t point, crossing;
};

// First of `items` from `begin` on that lies beyond a column.
template <typename Items>
size_t EndOfColumn(const Items& items, size_t begin, int column) {
  while (begin < items.size() && items[begin].column_px == column) ++begin;
  return begin;
}

// Change of u, sqrt of the variance, per sum.
struct Slopes {
  double found = 0, clipped = 0, deviation = 0, deviation2 = 0, crossings = 0, columns = 0,
         false_lines = 0;

  double operator()(const LineSums& s) const {
    return found * s.found + clipped * s.clipped + deviation * s.deviation_px +
           deviation2 * s.deviation2_px2 + crossings * s.crossings + columns * s.columns +
           false_lines * s.false_lines;
  }
};

}  // namespace

LineSums& LineSums::operator+=(const LineSums& other) {
  columns += other.columns;
  crossings += other.crossings;
  found += other.found;
  clipped += other.clipped;
  false_lines += other.false_lines;
  deviation_px += other.deviation_px;
  deviation2_px2 += other.deviation2_px2;
  return *this;
}

LineSums operator*(double weight, const LineSums& sums) {
  return {weight * sums.columns,       weight * sums.crossings,   weight * sums.found,
          weight * sums.clipped,       weight * sums.false_lines, weight * sums.deviation_px,
          weight * sums.deviation2_px2};
}

std::vector<LineSums> CompareLine(const std::vector<LinePoint>& detected,
                                  const std::vector<LineCrossing>& line, int columns_px,
                                  int block_px, double reach_px) {
  assert(block_px > 0);
  std::vector<LineSums> blocks(static_cast<size_t>((columns_px + block_px - 1) / block_px));
  size_t point = 0, crossing = 0;
  std::vector<CandidateMatch> pairs;
  std::vector<uint8_t> point_taken, crossing_taken;
  for (int column = 0; column < columns_px; ++column) {
    LineSums& sums = blocks[static_cast<size_t>(column / block_px)];
    sums.columns += 1;
    const size_t points_end = EndOfColumn(detected, point, column);
    const size_t crossings_end = EndOfColumn(line, crossing, column);
    sums.crossings += static_cast<double>(crossings_end - crossing);
    pairs.clear();
    for (size_t p = point; p < points_end; ++p) {
      for (size_t c = crossing; c < crossings_end; ++c) {
        const double distance = std::abs(detected[p].row_px - line[c].row_px);
        if (distance <= reach_px) pairs.push_back({distance, p, c});
      }
    }
    std::sort(pairs.begin(), pairs.end(), [](const CandidateMatch& a, const CandidateMatch& b) {
      return std::tie(a.distance_px, a.point, a.crossing) <
             std::tie(b.distance_px, b.point, b.crossing);
    });
    point_taken.assign(points_end - point, 0);
    crossing_taken.assign(crossings_end - crossing, 0);
    for (const CandidateMatch& pair : pairs) {
      if (point_taken[pair.point - point] || crossing_taken[pair.crossing - crossing]) continue;
      point_taken[pair.point - point] = crossing_taken[pair.crossing - crossing] = 1;
      const double deviation = detected[pair.point].row_px - line[pair.crossing].row_px;
      sums.found += 1;
      sums.clipped += detected[pair.point].saturated ? 1 : 0;
      sums.deviation_px += deviation;
      sums.deviation2_px2 += deviation * deviation;
    }
    sums.false_lines += static_cast<double>(std::count(point_taken.begin(), point_taken.end(), 0));
    point = points_end;
    crossing = crossings_end;
  }
  return blocks;
}

namespace {

// Part of the found crossings that counts as found.
double CountedPart(double clipped_fraction, const LineCost& cost) {
  return 1 - std::max(0.0, clipped_fraction - cost.max_clipped_fraction);
}

}  // namespace

LineQuality QualityOf(const LineSums& sums, const LineCost& cost) {
  LineQuality quality;
  quality.u_px = cost.prior_uncertainty_px;
  if (sums.crossings > 0) quality.profile_coverage = sums.found / sums.crossings;
  if (sums.columns > 0) quality.false_lines_per_column = sums.false_lines / sums.columns;
  if (sums.found > 0) {
    quality.bias_px = sums.deviation_px / sums.found;
    quality.rms_px = std::sqrt(sums.deviation2_px2 / sums.found);
    quality.clipped_fraction = sums.clipped / sums.found;
  }
  if (sums.found >= 2) {
    const double squares = sums.deviation2_px2 - sums.found * quality.bias_px * quality.bias_px;
    quality.u_px = std::sqrt(std::max(squares, 0.0) / (sums.found - 1));
  }
  const double a = quality.profile_coverage * CountedPart(quality.clipped_fraction, cost);
  quality.cost =
      a * quality.u_px + (1 - a) * cost.prior_uncertainty_px +
      cost.false_line_weight * cost.prior_uncertainty_px * quality.false_lines_per_column;
  return quality;
}

QualityEstimate::QualityEstimate(const std::vector<std::vector<LineSums>>& sums,
                                 const LineCost& cost)
    : realisations_(sums.empty() ? 0 : static_cast<int>(sums[0].size())) {
  assert(!sums.empty() && realisations_ >= 2);
  LineSums total;
  for (const std::vector<LineSums>& block : sums) {
    assert(static_cast<int>(block.size()) == realisations_);
    for (const LineSums& s : block) total += s;
  }
  total = (1.0 / realisations_) * total;
  crossings_ = total.crossings;
  mean_ = QualityOf(total, cost);

  // Derivatives of the numbers by the sums of one realisation.
  Slopes u, bias, rms, coverage, false_lines, f;
  if (total.crossings > 0) {
    coverage.found = 1 / total.crossings;
    coverage.crossings = -total.found / (total.crossings * total.crossings);
  }
  if (total.columns > 0) {
    false_lines.false_lines = 1 / total.columns;
    false_lines.columns = -total.false_lines / (total.columns * total.columns);
  }
  if (total.found > 0) {
    bias.deviation = 1 / total.found;
    bias.found = -mean_.bias_px / total.found;
    if (mean_.rms_px > 0) {
      rms.deviation2 = 1 / (2 * mean_.rms_px * total.found);
      rms.found = -mean_.rms_px / (2 * total.found);
    }
    if (total.found >= 2 && mean_.u_px > 0) {
      // u^2 = m2 - m1^2 up to the factor n/(n - 1), which hardly varies.
      const double m2 = total.deviation2_px2 / total.found;
      u.deviation2 = 1 / (2 * mean_.u_px * total.found);
      u.deviation = -mean_.bias_px / (mean_.u_px * total.found);
      u.found = (2 * mean_.bias_px * mean_.bias_px - m2) / (2 * mean_.u_px * total.found);
    }
  }
  const double counted = CountedPart(mean_.clipped_fraction, cost);
  const double a = mean_.profile_coverage * counted;
  const double by_coverage = (mean_.u_px - cost.prior_uncertainty_px) * counted;
  const double by_false = cost.false_line_weight * cost.prior_uncertainty_px;
  f.found = a * u.found + by_coverage * coverage.found;
  if (counted < 1) {
    const double by_clipped = -mean_.profile_coverage * (mean_.u_px - cost.prior_uncertainty_px);
    f.clipped = by_clipped / total.found;
    f.found -= by_clipped * mean_.clipped_fraction / total.found;
  }
  f.deviation = a * u.deviation;
  f.deviation2 = a * u.deviation2;
  f.crossings = by_coverage * coverage.crossings;
  f.columns = by_false * false_lines.columns;
  f.false_lines = by_false * false_lines.false_lines;

  changes_.reserve(sums.size() * static_cast<size_t>(realisations_));
  for (const std::vector<LineSums>& block : sums) {
    LineSums mean;
    for (const LineSums& s : block) mean += s;
    mean = (1.0 / realisations_) * mean;
    for (const LineSums& s : block) {
      LineSums d = s;
      d += -1.0 * mean;
      changes_.push_back({u(d), bias(d), rms(d), coverage(d), false_lines(d), f(d)});
    }
  }
}

QualityEstimate::Interval QualityEstimate::Around(double value, double Change::*number) const {
  double variance = 0;
  for (const Change& change : changes_) variance += change.*number * (change.*number);
  variance /= realisations_ - 1;
  const double half = kNormal95 * std::sqrt(variance * (1 + 1.0 / realisations_));
  return {value - half, value + half};
}

QualityEstimate::Interval QualityEstimate::u_px() const {
  Interval interval = Around(mean_.u_px, &Change::u_px);
  interval.lower = std::max(interval.lower, 0.0);
  return interval;
}
QualityEstimate::Interval QualityEstimate::bias_px() const {
  return Around(mean_.bias_px, &Change::bias_px);
}
QualityEstimate::Interval QualityEstimate::rms_px() const {
  Interval interval = Around(mean_.rms_px, &Change::rms_px);
  interval.lower = std::max(interval.lower, 0.0);
  return interval;
}
QualityEstimate::Interval QualityEstimate::profile_coverage() const {
  const double a = mean_.profile_coverage;
  Interval interval = Around(a, &Change::profile_coverage);
  const double misses = std::ceil(std::log(0.05) / -std::log(realisations_ + 1.0)) - 1;
  const double least = crossings_ > 0 ? misses / crossings_ : 0;
  interval.lower = std::clamp(std::min(interval.lower, a - least), 0.0, 1.0);
  interval.upper = std::clamp(std::max(interval.upper, a + least), 0.0, 1.0);
  return interval;
}
QualityEstimate::Interval QualityEstimate::false_lines_per_column() const {
  Interval interval = Around(mean_.false_lines_per_column, &Change::false_lines_per_column);
  interval.lower = std::max(interval.lower, 0.0);
  return interval;
}
QualityEstimate::Interval QualityEstimate::cost() const {
  Interval interval = Around(mean_.cost, &Change::cost);
  interval.lower = std::max(interval.lower, 0.0);
  return interval;
}

double QualityEstimate::CostStandardError() const {
  double variance = 0;
  for (const Change& change : changes_) variance += change.cost * change.cost;
  return std::sqrt(variance / (realisations_ - 1) / realisations_);
}

double QualityEstimate::StandardErrorOfDifference(const QualityEstimate& other) const {
  if (changes_.size() != other.changes_.size() || realisations_ != other.realisations_) {
    return std::hypot(CostStandardError(), other.CostStandardError());
  }
  double variance = 0;
  for (size_t i = 0; i < changes_.size(); ++i) {
    const double difference = changes_[i].cost - other.changes_[i].cost;
    variance += difference * difference;
  }
  return std::sqrt(variance / (realisations_ - 1) / realisations_);
}

}  // namespace sightline
