// SPDX-License-Identifier: Apache-2.0
// Local search: an evolution strategy around a point.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/random/random.h"
#include "planning/optimise/maximise.h"

namespace sightline {

struct Climbed {
  std::vector<double> x;
  double value = 0;    // no less than at the start
  bool moved = false;  // to another point, maybe of equal value
};

// Continues from `x` in [0, 1]^d (d > 0), at which the objective is `value`. Each of the `batches`
// evaluates 64 mutations of the best point so far; most change a few coordinates, and the step
// shrinks when nothing improves. `normalise` brings coordinates back into the cube. Errors of the
// objective are passed on.
absl::StatusOr<Climbed> Climb(
    std::vector<double> x, double value, int64_t batches, const BatchObjective& objective,
    const std::function<std::vector<double>(std::span<const double>)>& normalise, Random& random);

inline constexpr int64_t kClimbBatch = 64;

}  // namespace sightline
