// SPDX-License-Identifier: Apache-2.0
// Black-box maximisation over the unit cube with batched evaluations.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct Maximum {
  std::vector<double> x;
  double value = 0;
};

// Values of a batch of points, in order. Coordinates lie in [0, 1], those of periodic axes in
// [-0.5, 1.5]: the objective takes them modulo 1 (SearchSpace does). Every evaluated point passes
// through here, so a caller that wants to keep points collects them in its objective. A status
// that is not OK (e.g. CANCELLED) stops the search and is returned by Maximise.
using BatchObjective =
    std::function<absl::StatusOr<std::vector<double>>(std::span<const std::vector<double>>)>;

enum class Method {
  kParticleSwarm,          // SPSO-2007 (Bratton and Kennedy 2007): pagmo::pso_gen
  kGeneticAlgorithm,       // thesis Table 6.1: pagmo::sga
  kSimulatedAnnealing,     // thesis Table 6.1, chains in lockstep; own loop
  kCmaEs,                  // Hansen 2006: pagmo::cmaes
  kDifferentialEvolution,  // self-adaptive rand/1/bin (jDE): pagmo::sade
};

struct MaximiseOptions {
  // Axes that wrap around; empty: none. Otherwise one element per dimension.
  std::vector<bool> periodic;
  // Independent searches one after the other that share the evaluations equally.
  int restarts = 1;
  // Swarm, population or number of annealing chains; 0: the method's default (PSO 50, GA 200,
  // SA 50, CMA-ES 50, DE 50).
  int population = 0;
  // First population: these points, then uniformly random ones. CMA-ES starts at the best of them.
  // Every restart begins with the same points.
  std::vector<std::vector<double>> start;
  // CMA-ES: initial standard deviation. SA: standard deviation of a mutation. In (0, 1].
  double step = 0.3;
  // SA: k_B T_start in units of the objective.
  double start_temperature = 1;
};

// Searches the maximum with at most `evaluations` (> 0) evaluations: generational methods round
// down to whole generations. The same arguments give the same points in the same batches.
// Dimension 0 is evaluated once. Too few evaluations for a method's smallest population become a
// random search. Errors: those of the objective; INTERNAL when the library fails.
absl::StatusOr<Maximum> Maximise(Method method, int dimension, const BatchObjective& objective,
                                 int64_t evaluations, uint64_t seed,
                                 const MaximiseOptions& options = {});

}  // namespace sightline
