// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/measurability_matrix.h"

#include <gtest/gtest.h>

#include "core/random/random.h"

namespace sightline {
namespace {

Measurement Numbered(int i) {
  Measurement m;
  m.offset_y_m = i;
  return m;
}

std::vector<TargetBits> RandomRows(int rows, size_t targets, uint64_t seed) {
  Random random(seed);
  std::vector<TargetBits> result;
  for (int i = 0; i < rows; ++i) {
    // From nothing to nearly everything, so that both codings occur.
    const double density = std::pow(random.Uniform(), 3);
    TargetBits bits(targets);
    for (size_t t = 0; t < targets; ++t) {
      if (random.Uniform() < density) bits.Set(t);
    }
    result.push_back(bits);
  }
  result.push_back(TargetBits(targets));
  return result;
}

TEST(MeasurabilityMatrixTest, KeepsRowsThatCoverSomething) {
  for (size_t targets : {1u, 7u, 64u, 1001u, 5000u}) {
    MeasurabilityMatrix matrix(targets);
    const auto rows = RandomRows(60, targets, targets);
    std::vector<int> kept;
    for (size_t i = 0; i < rows.size(); ++i) {
      matrix.AddRow(Numbered(static_cast<int>(i)), rows[i]);
      if (rows[i].Count() > 0) kept.push_back(static_cast<int>(i));
    }
    ASSERT_EQ(matrix.rows(), kept.size());
    for (size_t r = 0; r < kept.size(); ++r) {
      EXPECT_EQ(matrix.measurement(r), Numbered(kept[r]));
      EXPECT_EQ(matrix.Row(r), rows[kept[r]]);
      EXPECT_EQ(matrix.NewTargets(r, rows[3]), rows[kept[r]].CountNotIn(rows[3]));
    }
  }
}

TEST(MeasurabilityMatrixTest, SparseRowsTakeAboutAByteATarget) {
  constexpr size_t kTargets = 20000;
  MeasurabilityMatrix matrix(kTargets);
  Random random(1);
  int64_t covered = 0;
  for (int r = 0; r < 2000; ++r) {
    TargetBits bits(kTargets);
    for (size_t t = 0; t < kTargets; ++t) {
      if (random.Uniform() < 0.03) bits.Set(t);
    }
    covered += bits.Count();
    matrix.AddRow(Numbered(r), bits);
  }
  // Twice for the growth of vectors.
  EXPECT_LT(static_cast<double>(matrix.MemoryBytes()),
            2 * (1.05 * static_cast<double>(covered) + 2000 * (sizeof(Measurement) + 9)));
}

TEST(MeasurabilityMatrixTest, LazyGreedyEqualsPlainGreedy) {
  constexpr size_t kTargets = 400;
  const auto rows = RandomRows(300, kTargets, 9);
  MeasurabilityMatrix matrix(kTargets);
  for (size_t i = 0; i < rows.size(); ++i) matrix.AddRow(Numbered(static_cast<int>(i)), rows[i]);

  LazyGreedy lazy(matrix);
  TargetBits covered(kTargets), plain_covered(kTargets);
  int chosen = 0;
  while (const auto choice = lazy.Next(covered)) {
    int64_t best_gain = 0;
    size_t best = 0;
    for (size_t r = 0; r < matrix.rows(); ++r) {
      if (const int64_t gain = matrix.Row(r).CountNotIn(plain_covered); gain > best_gain) {
        best_gain = gain;
        best = r;
      }
    }
    ASSERT_EQ(choice->row, best);
    ASSERT_EQ(choice->new_targets, best_gain);
    covered |= matrix.Row(choice->row);
    plain_covered |= matrix.Row(best);
    ++chosen;
  }
  EXPECT_GE(chosen, 2);
  TargetBits all(kTargets);
  for (const TargetBits& row : rows) all |= row;
  EXPECT_EQ(covered, all);
}

}  // namespace
}  // namespace sightline
