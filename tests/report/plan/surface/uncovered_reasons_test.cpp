// SPDX-License-Identifier: Apache-2.0
#include "report/plan/surface/uncovered_reasons.h"

#include <gtest/gtest.h>

#include <numeric>

namespace sightline {
namespace {

// Ten targets: 0 covered; 1 to 4 not chosen; 5 to 7 hidden by the part; 8 by obstacle 0, 9 by
// obstacle 1. Even ones are measurable.
struct Example {
  std::vector<TargetReason> reasons;
  TargetBits measurable = TargetBits(10);
  std::vector<std::string> names = {"clamp", "table"};
  std::vector<uint32_t> all = std::vector<uint32_t>(10);

  Example() {
    reasons.push_back({});
    for (int i = 0; i < 4; ++i) reasons.push_back({v1::UNCOVERED_REASON_NOT_CHOSEN, -1});
    for (int i = 0; i < 3; ++i) reasons.push_back({v1::UNCOVERED_REASON_OWN_OCCLUSION, -1});
    for (int i = 0; i < 2; ++i) reasons.push_back({v1::UNCOVERED_REASON_OBSTACLE, i});
    for (size_t t = 0; t < 10; t += 2) measurable.Set(t);
    std::iota(all.begin(), all.end(), 0u);
  }
};

TEST(UncoveredReasons, CountsByReasonObstacleAndMeasurability) {
  const Example e;
  const auto counts = CountReasons(e.reasons, e.measurable, e.names, e.all);
  ASSERT_EQ(counts.size(), 6u);
  const auto expect = [&](size_t i, v1::UncoveredReason reason, const std::string& obstacle,
                          int64_t targets, bool measurable) {
    EXPECT_EQ(counts[i].reason(), reason) << i;
    EXPECT_EQ(counts[i].obstacle(), obstacle) << i;
    EXPECT_EQ(counts[i].targets(), targets) << i;
    EXPECT_EQ(counts[i].measurable(), measurable) << i;
  };
  expect(0, v1::UNCOVERED_REASON_NOT_CHOSEN, "", 2, true);
  expect(1, v1::UNCOVERED_REASON_OWN_OCCLUSION, "", 1, true);
  expect(2, v1::UNCOVERED_REASON_OBSTACLE, "clamp", 1, true);
  expect(3, v1::UNCOVERED_REASON_NOT_CHOSEN, "", 2, false);
  expect(4, v1::UNCOVERED_REASON_OWN_OCCLUSION, "", 2, false);
  expect(5, v1::UNCOVERED_REASON_OBSTACLE, "table", 1, false);
  const std::vector<uint32_t> some = {0, 9, 5};
  EXPECT_EQ(CountReasons(e.reasons, e.measurable, e.names, some).size(), 2u);
}

TEST(UncoveredReasons, ListsTheMostFrequentFirst) {
  const Example e;
  const auto counts = CountReasons(e.reasons, e.measurable, e.names, e.all);
  const auto joined = JoinMeasurable(counts);
  ASSERT_EQ(joined.size(), 4u);
  EXPECT_EQ(joined[0].targets(), 4);
  EXPECT_EQ(joined[1].targets(), 3);
  EXPECT_EQ(
      ReasonList(counts, 9),
      "not chosen: other scans would measure it (4), hidden by the part itself (3), hidden by "
      "clamp (1), hidden by table (1)");
  EXPECT_EQ(ReasonList(counts, 1), "not chosen: other scans would measure it (4), others (5)");
  EXPECT_EQ(ReasonList({}, 3), "");
}

}  // namespace
}  // namespace sightline
