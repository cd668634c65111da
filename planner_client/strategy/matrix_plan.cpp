#include "planner_client/strategy/matrix_plan.h"

#include "planner_client/optimise/random.h"
#include "planner_client/strategy/greedy_plan.h"
#include "planner_client/strategy/measurability_matrix.h"

namespace sightline {

absl::StatusOr<PlannerResult> PlanWithMatrix(PlanRun& run) {
  constexpr int64_t kBatch = 256;
  const PlannerRequest& request = run.request();
  MeasurabilityMatrix matrix(run.oracle().measurable().size());
  Random random(DeriveSeed(static_cast<uint64_t>(request.seed), 0));
  for (int64_t done = 0; done < request.matrix_samples && !run.Stopped(); done += kBatch) {
    std::vector<Measurement> batch;
    for (int64_t i = done; i < std::min(done + kBatch, request.matrix_samples); ++i) {
      std::vector<double> x(run.space().dimension());
      for (double& coordinate : x) coordinate = random.Uniform();
      batch.push_back(run.space().ToMeasurement(x));
    }
    auto coverage = run.oracle().FastCoverage(batch);
    if (run.IsStop(coverage.status())) break;
    if (!coverage.ok()) return coverage.status();
    for (size_t i = 0; i < batch.size(); ++i) {
      if ((*coverage)[i].feasibility == ScanFeasibility::kFeasible) {
        matrix.AddRow(batch[i], (*coverage)[i].covered);
      }
    }
    run.Report("filling the measurability matrix", 0, 0);
  }

  LazyGreedy greedy(matrix);
  return PlanGreedily(run,
                      [&](const TargetBits& covered, int64_t,
                          uint64_t) -> absl::StatusOr<std::vector<Measurement>> {
                        std::vector<Measurement> result;
                        if (const auto choice = greedy.Next(covered)) {
                          result.push_back(matrix.measurement(choice->row));
                        }
                        return result;
                      });
}

}  // namespace sightline
