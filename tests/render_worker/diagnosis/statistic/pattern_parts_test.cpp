// SPDX-License-Identifier: Apache-2.0
// Fixed patterns on parts of the pixels: each part has the expectation of the whole and four times
// its covariance. Pixels are drawn as independent normal values.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/random/counter_random.h"
#include "render_worker/diagnosis/statistic/pattern/fixed_pattern_statistic.h"
#include "render_worker/diagnosis/statistic/pattern/pair_products.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

constexpr int kPartsColumns = 192, kPartsRows = 32;
constexpr int kLaserBlock = 1, kDarkBlock = 0;

RecordedSet Planned() {
  RecordingSet description = SmallSetDescription();
  for (RecordedImage& image : description.recordings) {
    image.roi_columns_px = kPartsColumns;
    image.roi_rows_px = kPartsRows;
  }
  return MakeRecordedSet(std::move(description), {});
}

// Signal of a recording relative to its brightest row.
double LineProfile(int row) { return std::exp(-std::pow((row - 0.5 * kPartsRows) / 4, 2) / 2); }

// Draws every recording: a line with a relative noise of 0.2, which is speckle's part, and pixels
// of relative sensitivity 1 + prnu n; all have normal noise of 1 DN in addition. n is normal and
// common to all recordings. The light falls by `falling` from the left end to the right end.
void Draw(uint64_t seed, double prnu, double falling, RecordedSet* set) {
  constexpr double kOffset_dn = 5, kSignal_dn = 800, kNoise = 0.2, kDarkNoise_dn = 1;
  for (size_t f = 0; f < set->frames.size(); ++f) {
    const bool lit = set->frames[f].plate_position_id >= 0;
    Image<uint16_t> raw(kPartsColumns, kPartsRows);
    for (int row = 0; row < kPartsRows; ++row) {
      const double profile = LineProfile(row);
      for (int c = 0; c < kPartsColumns; ++c) {
        const auto pixel = static_cast<uint64_t>(row * kPartsColumns + c);
        const auto [noise, dark] =
            CounterRandom(seed, pixel, static_cast<uint32_t>(f)).NormalPair();
        const double sensitivity =
            prnu > 0 ? 1 + prnu * CounterRandom(seed + 1'000'000, pixel).Normal() : 1;
        const double light = profile * (1 + falling * (0.5 - (c + 0.5) / kPartsColumns));
        const double signal = lit ? kSignal_dn * light * sensitivity * (1 + kNoise * noise) : 0;
        raw.At(row, c) = static_cast<uint16_t>(
            std::lround(std::max(0.0, kOffset_dn + signal + kDarkNoise_dn * dark)));
      }
    }
    set->frames[f].raw_dn = std::move(raw);
  }
}

// Sums over sets of one component.
struct Moments {
  double whole = 0, squared_whole = 0, squared_part = 0, squared_difference = 0;
  std::array<double, kObservedParts> part{};
};

// Moments of the leading components of a block over `sets` sets.
std::vector<Moments> MomentsOf(int block, int sets, double prnu, double falling) {
  RecordedSet set = Planned();
  std::vector<Moments> moments;
  for (int seed = 1; seed <= sets; ++seed) {
    Draw(static_cast<uint64_t>(seed), prnu, falling, &set);
    const FixedPatternStatistic statistic(set);
    EXPECT_EQ(statistic.blocks(), 2);
    const Eigen::VectorXd whole = statistic.Observed(set, block);
    const std::vector<Eigen::VectorXd> parts = statistic.ObservedOfParts(set, block);
    EXPECT_EQ(parts.size(), kObservedParts);
    moments.resize(static_cast<size_t>(parts.front().size()));
    for (size_t l = 0; l < moments.size(); ++l) {
      const auto component = static_cast<Eigen::Index>(l);
      double mean = 0;
      for (size_t k = 0; k < parts.size(); ++k) {
        const double value = parts[k][component];
        mean += value / kObservedParts;
        moments[l].part[k] += value / sets;
        moments[l].squared_part += value * value / (kObservedParts * sets);
      }
      moments[l].whole += whole[component] / sets;
      moments[l].squared_whole += whole[component] * whole[component] / sets;
      moments[l].squared_difference += std::pow(mean - whole[component], 2) / sets;
    }
  }
  return moments;
}

// Without a pattern the expectation is 0. Relative standard errors of the variances are
// sqrt(2 / 200) = 0.1 of the whole and 0.05 of the parts: 0.11 of their ratio. The limits are four
// of them.
void ExpectFourTimesTheCovariance(const std::vector<Moments>& moments) {
  for (size_t l = 0; l < moments.size(); ++l) {
    EXPECT_NEAR(moments[l].squared_part / moments[l].squared_whole, kObservedParts,
                0.45 * kObservedParts)
        << l;
  }
}

TEST(ObservedOfParts, PartsOfASensitivityPatternHaveFourTimesTheCovariance) {
  const std::vector<Moments> moments = MomentsOf(kLaserBlock, 200, 0, 0);
  ASSERT_EQ(moments.size(), kLagCount);
  ExpectFourTimesTheCovariance(moments);
  for (size_t l = 0; l < moments.size(); ++l) {
    // Stripes begin at even columns, so parts differ in width by at most a tenth.
    EXPECT_LT(moments[l].squared_difference, 0.1 * 0.1 * moments[l].squared_whole) << l;
  }
}

TEST(ObservedOfParts, PartsOfADarkPatternHaveFourTimesTheCovariance) {
  const std::vector<Moments> moments = MomentsOf(kDarkBlock, 200, 0, 0);
  ASSERT_EQ(moments.size(), 2);
  ExpectFourTimesTheCovariance(moments);
  for (size_t l = 0; l < moments.size(); ++l) {
    // Eight stripes of 24 columns: all parts are equal.
    EXPECT_LT(moments[l].squared_difference, 1e-18 * moments[l].squared_whole) << l;
  }
}

// Segment means, and weights by the variance of the same pixels, take 9 % of the product at lag 0.
// Light that falls by a fifth along the line differs by 4 % in the first and the last part, and its
// square by 8 %. The standard error of a part's mean over 50 sets is 1 %.
TEST(ObservedOfParts, EveryPartHasTheExpectationOfTheWhole) {
  constexpr double kPrnu = 0.1;
  for (const double falling : {0.0, 0.2}) {
    const Moments moments = MomentsOf(kLaserBlock, 50, kPrnu, falling)[0];
    EXPECT_NEAR(moments.whole / (kPrnu * kPrnu), 1, 0.15);
    for (const double part : moments.part) {
      EXPECT_NEAR(part / moments.whole, 1, 0.04 + 0.4 * falling);
    }
  }
}

TEST(ObservedOfParts, NarrowRegionsAndPlannedSetsHaveNone) {
  const RecordedSet planned = Planned();
  const FixedPatternStatistic statistic(planned);
  for (int block = 0; block < statistic.blocks(); ++block) {
    EXPECT_TRUE(statistic.ObservedOfParts(planned, block).empty());
  }
  RecordedSet narrow = planned;
  Draw(1, 0, 0, &narrow);
  for (RecordedFrame& frame : narrow.frames) {
    constexpr int kNarrow_px = 90;
    Image<uint16_t> raw(kNarrow_px, kPartsRows);
    for (int row = 0; row < kPartsRows; ++row) {
      for (int c = 0; c < kNarrow_px; ++c) raw.At(row, c) = frame.raw_dn.At(row, c);
    }
    frame.raw_dn = std::move(raw);
    frame.nominal.roi.columns_px = kNarrow_px;
  }
  const FixedPatternStatistic of_narrow(narrow);
  ASSERT_GT(of_narrow.blocks(), 0);
  for (int block = 0; block < of_narrow.blocks(); ++block) {
    EXPECT_TRUE(of_narrow.ObservedOfParts(narrow, block).empty());
  }
}

}  // namespace
}  // namespace sightline
