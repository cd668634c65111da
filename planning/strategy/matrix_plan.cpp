// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/matrix_plan.h"

#include "core/random/random.h"
#include "planning/strategy/greedy_plan.h"
#include "planning/strategy/measurability_matrix.h"

namespace sightline {

namespace {

// Targets that the scan alone satisfies: the matrix has no fractions.
TargetBits SettledAlone(const GainModel& gain_model, const ScanCoverage& scan) {
  if (!gain_model.ScoresPlans()) return scan.covered;
  TargetBits satisfied(gain_model.measurable().size());
  for (size_t i = 0; i < scan.shares.targets.size(); ++i) {
    if (scan.shares.share[i] >= 1) satisfied.Set(scan.shares.targets[i]);
  }
  satisfied &= gain_model.measurable();
  return satisfied;
}

}  // namespace

absl::StatusOr<PlannerResult> PlanWithMatrix(PlanRun& run) {
  constexpr int64_t kBatch = 256;
  constexpr double kFillingShare = 0.95;  // of the time, at the default number of samples
  const PlannerRequest& request = run.request();
  MeasurabilityMatrix matrix(run.gain_model().measurable().size());
  Random random(DeriveSeed(static_cast<uint64_t>(request.seed), 0));
  for (int64_t done = 0; done < request.matrix_samples && !run.Stopped(); done += kBatch) {
    std::vector<Measurement> batch;
    for (int64_t i = done; i < std::min(done + kBatch, request.matrix_samples); ++i) {
      std::vector<double> x(run.space().dimension());
      for (double& coordinate : x) coordinate = random.Uniform();
      batch.push_back(run.space().ToMeasurement(x));
    }
    auto coverage = run.gain_model().FastCoverage(batch);
    if (run.IsStop(coverage.status())) break;
    if (!coverage.ok()) return coverage.status();
    for (size_t i = 0; i < batch.size(); ++i) {
      if ((*coverage)[i].feasibility == ScanFeasibility::kFeasible) {
        matrix.AddRow(batch[i], SettledAlone(run.gain_model(), (*coverage)[i]));
      }
    }
    run.SetPrepared(kFillingShare * static_cast<double>(done + static_cast<int64_t>(batch.size())) /
                    static_cast<double>(request.matrix_samples));
    run.Report("filling the measurability matrix", 0, 0);
  }

  LazyGreedy greedy(matrix);
  return PlanGreedily(
      run,
      [&](const std::vector<float>& known, int64_t,
          uint64_t) -> absl::StatusOr<std::vector<Measurement>> {
        std::vector<Measurement> result;
        if (const auto choice = greedy.Next(Satisfied(run.gain_model().measurable(), known))) {
          result.push_back(matrix.measurement(choice->row));
        }
        return result;
      });
}

}  // namespace sightline
