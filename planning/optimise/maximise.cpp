// SPDX-License-Identifier: Apache-2.0
#include "planning/optimise/maximise.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <exception>
#include <limits>
#include <pagmo/algorithms/cmaes.hpp>
#include <pagmo/algorithms/pso_gen.hpp>
#include <pagmo/algorithms/sade.hpp>
#include <pagmo/algorithms/sga.hpp>
#include <pagmo/batch_evaluators/member_bfe.hpp>
#include <pagmo/bfe.hpp>
#include <pagmo/population.hpp>
#include <pagmo/problem.hpp>
#include <stdexcept>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/random/random.h"

namespace sightline {

namespace {

using Points = std::vector<std::vector<double>>;

// A periodic axis is searched half a turn beyond either end, so that a swarm can cross the seam.
constexpr double kPeriodicMargin = 0.5;

// Thrown through pagmo's code when the objective fails; Evaluator::status holds the reason.
struct ObjectiveFailed : std::exception {
  const char* what() const noexcept override { return "objective failed"; }
};

// Evaluates batches, remembers the best point and the first error.
class Evaluator {
 public:
  Evaluator(const BatchObjective& objective, int64_t budget)
      : objective_(objective), budget_(budget) {}

  std::vector<double> operator()(const Points& points) {
    assert(static_cast<int64_t>(points.size()) <= budget_);
    budget_ -= static_cast<int64_t>(points.size());
    absl::StatusOr<std::vector<double>> values = objective_(points);
    if (values.ok() && values->size() != points.size()) {
      values = absl::InternalError(absl::StrCat("objective returned ", values->size(),
                                                " values for ", points.size(), " points"));
    }
    if (!values.ok()) {
      status = values.status();
      throw ObjectiveFailed();
    }
    for (size_t i = 0; i < points.size(); ++i) {
      if (best.x.size() != points[i].size() || (*values)[i] > best.value) {
        best = {points[i], (*values)[i]};
      }
    }
    return *std::move(values);
  }

  int64_t budget() const { return budget_; }

  absl::Status status;
  Maximum best{{}, -std::numeric_limits<double>::infinity()};

 private:
  const BatchObjective& objective_;
  int64_t budget_;
};

// The problem that pagmo solves: the negated objective over the box. Copies share the state by
// pointer.
//
// pagmo::sga, cmaes and sade request one fitness at a time, although the points of a generation do
// not depend on the answers. Each generation therefore runs twice with the same random numbers:
// first on a temporary copy that records the points, then, after one batched evaluation, on the
// original with the recorded answers. A point that was not recorded at its position (none, as tests
// check) is evaluated alone.
struct PagmoProblem {
  struct State {
    Evaluator* evaluator = nullptr;
    std::vector<double> lower, upper;
    bool recording = false;
    Points recorded;
    std::vector<double> answers;
    size_t next = 0;
    int64_t single_evaluations = 0;
  };
  State* state = nullptr;

  pagmo::vector_double fitness(const pagmo::vector_double& x) const {
    if (state->recording) {
      state->recorded.push_back(x);
      return {0.0};
    }
    if (state->next < state->answers.size() && state->recorded[state->next] == x) {
      return {-state->answers[state->next++]};
    }
    ++state->single_evaluations;
    return {-(*state->evaluator)({x}).front()};
  }

  pagmo::vector_double batch_fitness(const pagmo::vector_double& points) const {
    const size_t dimension = state->lower.size();
    Points batch;
    for (size_t i = 0; i < points.size(); i += dimension) {
      batch.emplace_back(points.begin() + static_cast<std::ptrdiff_t>(i),
                         points.begin() + static_cast<std::ptrdiff_t>(i + dimension));
    }
    pagmo::vector_double values = (*state->evaluator)(batch);
    for (double& value : values) value = -value;
    return values;
  }

  std::pair<pagmo::vector_double, pagmo::vector_double> get_bounds() const {
    if (state == nullptr) return {{0.0}, {1.0}};
    return {state->lower, state->upper};
  }
};

// One generation of an algorithm without batched evaluation. The algorithm keeps its state
// between calls (pagmo's "memory").
template <typename Algorithm>
void EvolveOneGeneration(Algorithm& algorithm, pagmo::population& population,
                         PagmoProblem::State& state) {
  state.recorded.clear();
  state.answers.clear();
  state.next = 0;
  state.recording = true;
  Algorithm(algorithm).evolve(population);
  state.recording = false;
  const auto asked = static_cast<int64_t>(state.recorded.size());
  if (asked <= state.evaluator->budget()) state.answers = (*state.evaluator)(state.recorded);
  population = algorithm.evolve(population);
}

struct Search {
  int dimension;
  const MaximiseOptions& options;
  Evaluator& evaluator;
  int64_t evaluations;
  uint64_t seed;
};

Points FirstPopulation(const Search& search, size_t size) {
  Points points = search.options.start;
  points.resize(std::min(points.size(), size));
  Random random(DeriveSeed(search.seed, 0));
  while (points.size() < size) {
    std::vector<double> x(search.dimension);
    for (double& coordinate : x) coordinate = random.Uniform();
    points.push_back(std::move(x));
  }
  return points;
}

void RandomSearch(const Search& search) {
  search.evaluator(FirstPopulation(search, static_cast<size_t>(search.evaluations)));
}

int64_t PopulationSize(const Search& search, Method method) {
  int64_t size = search.options.population;
  if (size == 0) size = method == Method::kGeneticAlgorithm ? 200 : 50;
  return std::min(size, search.evaluations);
}

void SearchWithPagmo(const Search& search, Method method) {
  const int64_t size = PopulationSize(search, method);
  // Smallest population each algorithm accepts: sade's rand/1 takes seven.
  if (size < 7) return RandomSearch(search);

  PagmoProblem::State state;
  state.evaluator = &search.evaluator;
  state.lower.assign(search.dimension, 0.0);
  state.upper.assign(search.dimension, 1.0);
  for (int i = 0; i < search.dimension; ++i) {
    if (!search.options.periodic.empty() && search.options.periodic[i]) {
      state.lower[i] -= kPeriodicMargin;
      state.upper[i] += kPeriodicMargin;
    }
  }
  const auto pagmo_seed = static_cast<unsigned>(DeriveSeed(search.seed, 1));
  pagmo::population population(pagmo::problem(PagmoProblem{&state}), 0, pagmo_seed);
  const Points first = FirstPopulation(search, static_cast<size_t>(size));
  const std::vector<double> values = search.evaluator(first);
  for (size_t i = 0; i < first.size(); ++i) population.push_back(first[i], {-values[i]});

  const auto generations = static_cast<unsigned>(search.evaluations / size - 1);
  const auto evolve = [&](auto algorithm) {
    for (unsigned g = 0; g < generations; ++g) EvolveOneGeneration(algorithm, population, state);
  };
  switch (method) {
    case Method::kParticleSwarm: {
      if (generations == 0) break;
      // Bratton and Kennedy 2007: inertia 1/(2 ln 2), acceleration 1/2 + ln 2, each particle
      // informs three others chosen anew after a step without improvement. pagmo: variant 1
      // (inertia weight, own random factor per component), topology 4 (adaptive random).
      pagmo::pso_gen algorithm(generations, 0.7213, 1.193, 1.193, 1.0, 1, 4, 3, false, pagmo_seed);
      algorithm.set_bfe(pagmo::bfe(pagmo::member_bfe()));
      algorithm.evolve(population);
      break;
    }
    case Method::kGeneticAlgorithm:
      // Table 6.1: crossover 0.7, mutation 0.3; the thesis does not name the operators.
      evolve(pagmo::sga(1, 0.7, 1.0, 0.3, 0.1, 2, "exponential", "gaussian", "tournament",
                        pagmo_seed));
      break;
    case Method::kCmaEs:
      evolve(pagmo::cmaes(1, -1, -1, -1, -1, search.options.step, 0, 0, true, true, pagmo_seed));
      break;
    case Method::kDifferentialEvolution:
      evolve(pagmo::sade(1, 7, 1, 0, 0, true, pagmo_seed));
      break;
    case Method::kSimulatedAnnealing:
      assert(false);
  }
}

// Thesis algorithm 4 with the schedule of Table 6.1, T_k = T_start (1 - k / k_max)^3. The chains
// (the thesis's restarts) advance together so that every step is one batch.
void SimulatedAnnealing(const Search& search) {
  const int64_t chains = PopulationSize(search, Method::kSimulatedAnnealing);
  const int64_t steps = search.evaluations / chains;
  Random random(DeriveSeed(search.seed, 2));
  Points current = FirstPopulation(search, static_cast<size_t>(chains));
  std::vector<double> current_values = search.evaluator(current);
  for (int64_t k = 1; k < steps; ++k) {
    const double progress = static_cast<double>(k) / static_cast<double>(steps);
    const double temperature = search.options.start_temperature * std::pow(1 - progress, 3);
    Points proposed = current;
    for (auto& x : proposed) {
      for (int i = 0; i < search.dimension; ++i) {
        x[i] += search.options.step * random.Normal();
        if (!search.options.periodic.empty() && search.options.periodic[i]) {
          x[i] -= std::floor(x[i]);
        } else {
          // Reflect at the walls, so that they do not collect points.
          x[i] = std::abs(std::remainder(x[i], 2.0));
        }
      }
    }
    const std::vector<double> values = search.evaluator(proposed);
    for (size_t c = 0; c < current.size(); ++c) {
      const double loss = current_values[c] - values[c];
      const double chance = random.Uniform();
      if (loss < 0 || chance < std::exp(-loss / temperature)) {
        current[c] = std::move(proposed[c]);
        current_values[c] = values[c];
      }
    }
  }
}

}  // namespace

absl::StatusOr<Maximum> Maximise(Method method, int dimension, const BatchObjective& objective,
                                 int64_t evaluations, uint64_t seed,
                                 const MaximiseOptions& options) {
  assert(dimension >= 0 && evaluations > 0 && options.restarts > 0);
  assert(options.periodic.empty() || static_cast<int>(options.periodic.size()) == dimension);
  Evaluator evaluator(objective, evaluations);
  try {
    if (dimension == 0) {
      evaluator({{}});
      return evaluator.best;
    }
    const int64_t restarts = std::min<int64_t>(options.restarts, evaluations);
    for (int64_t r = 0; r < restarts; ++r) {
      const Search search{dimension, options, evaluator, evaluations / restarts,
                          DeriveSeed(seed, static_cast<uint64_t>(r))};
      if (method == Method::kSimulatedAnnealing) {
        SimulatedAnnealing(search);
      } else {
        SearchWithPagmo(search, method);
      }
    }
  } catch (const ObjectiveFailed&) {
    return evaluator.status;
  } catch (const std::exception& e) {
    if (!evaluator.status.ok()) return evaluator.status;
    return absl::InternalError(absl::StrCat("optimiser failed: ", e.what()));
  }
  return evaluator.best;
}

}  // namespace sightline
