// SPDX-License-Identifier: Apache-2.0
#include "planning/optimise/climb.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/status/status_macros.h"

namespace sightline {

absl::StatusOr<Climbed> Climb(
    std::vector<double> x, double value, int64_t batches, const BatchObjective& objective,
    const std::function<std::vector<double>(std::span<const double>)>& normalise, Random& random) {
  Climbed best{std::move(x), value, false};
  const auto dimension = static_cast<double>(best.x.size());
  double step = 0.1;
  for (int64_t batch = 0; batch < batches; ++batch) {
    std::vector<std::vector<double>> points;
    for (int64_t i = 0; i < kClimbBatch; ++i) {
      std::vector<double> y = best.x;
      const double scale = step * std::exp(random.Normal());
      const double share = i % 2 == 0 ? 1.0 : 2.0 / dimension;
      for (double& coordinate : y) {
        if (random.Uniform() < share) coordinate += scale * random.Normal();
      }
      points.push_back(normalise(y));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(auto values, objective(points));
    const auto top = std::max_element(values.begin(), values.end());
    if (*top >= best.value) {
      step = *top > best.value ? step : step * 0.7;
      best = {points[static_cast<size_t>(top - values.begin())], *top, true};
    } else {
      step *= 0.5;
    }
  }
  return best;
}

}  // namespace sightline
