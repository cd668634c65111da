// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/converter/code_widths.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "absl/strings/str_format.h"
#include "core/statistics/normal_distribution.h"
#include "core/statistics/order_statistics.h"
#include "core/statistics/square.h"
#include "render_worker/sensor_diagnosis/departure_names.h"
#include "render_worker/sensor_diagnosis/frames/temporal_variance.h"

namespace sightline {
namespace {

// Binomial weights of the eighth difference, of nine codes.
constexpr std::array<double, 9> kEighthDifference = {1, 8, 28, 56, 70, 56, 28, 8, 1};
// Fewest counts of a code: its standard error is then below 10 %.
constexpr int64_t kFewestCountsOfCode = 100;
// Fewest blocks of codes whose median is robust. Chosen.
constexpr size_t kFewestCodeBlocks = 6;
// Blocks farther from the median are outliers [standard errors]. Chosen.
constexpr double kOutlyingBlock = 4;
// Smallest difference of widths that matters [steps]. Chosen.
constexpr double kMaterialCodeWidth = 0.02;
// Standard deviation of a normal distribution over its median absolute deviation, and standard
// error of a median over that of a mean, sqrt(pi / 2) (Huber and Ronchetti, Robust Statistics).
constexpr double kDeviationOfMedian = 1.4826, kMedianOverMean = 1.2533;

struct BlockWidth {
  double width, error;  // odd less even codes over both [1]
};

// Differences of odd and even codes over blocks of nine neighbouring codes. The eighth difference
// of the counts vanishes for every smooth course of the histogram (a polynomial of up to the
// seventh degree), but not for codes that are alternately wide and narrow. The lowest and the
// highest code that occur are left out: they hold everything that was clipped there.
std::vector<BlockWidth> WidthsOfBlocks(const Histogram& histogram, int largest) {
  const auto occurs = [](int64_t count) { return count > 0; };
  const auto lowest = std::find_if(histogram.begin(), histogram.end(), occurs);
  const auto highest = std::find_if(histogram.rbegin(), histogram.rend(), occurs);
  const int first = static_cast<int>(lowest - histogram.begin()) + 1;
  const int limit = std::min(largest, static_cast<int>(histogram.rend() - highest) - 1);
  constexpr int kCodes = static_cast<int>(kEighthDifference.size());
  std::vector<BlockWidth> blocks;
  int block = first;
  while (block + kCodes <= limit) {
    double excess = 0, total = 0, variance = 0;
    int rare = -1;
    for (int k = 0; k < kCodes; ++k) {
      const int code = block + k;
      if (histogram[code] < kFewestCountsOfCode) rare = code;
      const double count = static_cast<double>(histogram[code]);
      const double weight = kEighthDifference[k];
      excess += (code % 2 == 1 ? weight : -weight) * count;
      total += weight * count;
      variance += weight * weight * count;
    }
    if (rare >= 0) {
      block = rare + 1;
      continue;
    }
    blocks.push_back({excess / total, std::sqrt(variance) / total});
    block += kCodes;
  }
  return blocks;
}

// Blocks that agree with the median within `kOutlyingBlock` standard errors of block and median. If
// all blocks differ by more than chance, the bound is wider in proportion. A few blocks deviate
// for other reasons (clipping at several levels, a peak narrower than a code); the odd codes of a
// converter are wide over its whole range.
std::vector<BlockWidth> AgreeingBlocks(const std::vector<BlockWidth>& blocks) {
  std::vector<double> widths, deviations;
  for (const BlockWidth& block : blocks) widths.push_back(block.width);
  const double median = UpperMedian(widths);
  for (const double width : widths) deviations.push_back(std::abs(width - median));
  const double median_error = kMedianOverMean * kDeviationOfMedian * UpperMedian(deviations) /
                              std::sqrt(static_cast<double>(blocks.size()));
  std::vector<double> in_errors;
  for (const BlockWidth& block : blocks) {
    in_errors.push_back(std::abs(block.width - median) / std::hypot(block.error, median_error));
  }
  const double bound = kOutlyingBlock * std::max(1.0, kDeviationOfMedian * UpperMedian(in_errors));
  std::vector<BlockWidth> agreeing;
  for (const BlockWidth& block : blocks) {
    if (std::abs(block.width - median) <= bound * std::hypot(block.error, median_error)) {
      agreeing.push_back(block);
    }
  }
  return agreeing;
}

}  // namespace

Departure OddEvenWidth(const Histogram& histogram, int largest) {
  Departure departure{.effect = NamesInVocabulary().odd_even_width, .stage = "readout"};
  const std::vector<BlockWidth> blocks = WidthsOfBlocks(histogram, largest);
  if (blocks.size() < kFewestCodeBlocks) {
    departure.testable = false;
    departure.description = absl::StrFormat(
        "needs at least %d ranges of %d numbers that all occur %d times, apart from the lowest and "
        "the highest number: more steps of different light",
        kFewestCodeBlocks, kEighthDifference.size(), kFewestCountsOfCode);
    return departure;
  }
  const std::vector<BlockWidth> agreeing = AgreeingBlocks(blocks);
  if (agreeing.size() < std::max(kFewestCodeBlocks, blocks.size() / 2)) {
    departure.testable = false;
    departure.description =
        "ranges of numbers contradict one another: widths of odd and even "
        "numbers cannot be compared";
    return departure;
  }
  WeightedMean mean;
  for (const BlockWidth& block : agreeing) mean.Add(block.width, block.error);
  double chi_squared = 0;
  for (const BlockWidth& block : agreeing) {
    chi_squared += Square((block.width - mean.Mean()) / block.error);
  }
  // If blocks differ by more than their errors, the error of the mean grows (Birge ratio).
  const double birge_ratio =
      std::sqrt(std::max(1.0, chi_squared / static_cast<double>(agreeing.size() - 1)));
  const double difference = 2 * mean.Mean(), error = 2 * birge_ratio * mean.Error();
  departure.description = absl::StrFormat(
      "odd numbers are wider than even ones by %.3g of a step (differential nonlinearity)",
      difference);
  departure.p_value = NormalTwoSidedTail(difference / error);
  departure.material = std::abs(difference) > kMaterialCodeWidth;
  departure.parameters.push_back({"odd_minus_even_width", "DN", difference, error});
  return departure;
}

}  // namespace sightline
