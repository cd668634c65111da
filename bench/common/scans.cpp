// SPDX-License-Identifier: Apache-2.0
#include "bench/common/scans.h"

#include <algorithm>
#include <numbers>

#include "absl/strings/str_format.h"
#include "bench/common/measure.h"
#include "bench/common/scene_gain_model.h"
#include "core/inspection/inspection.h"
#include "core/random/random.h"
#include "planning/optimise/search_space.h"
#include "planning/strategy/planner.h"

namespace sightline::bench {
namespace {

using Point = std::vector<double>;

Point RandomPoint(const SearchSpace& space, Random& random) {
  Point point(space.dimension());
  for (double& x : point) x = random.Uniform();
  return point;
}

Point Step(const SearchSpace& space, const Point& from, double step, Random& random) {
  Point point = from;
  for (double& x : point) x += step * random.Normal();
  return space.Normalise(point);
}

std::vector<FastGain> Gains(const CoverageScene& scene, const std::vector<Measurement>& scans) {
  std::vector<FastGain> gains(scans.size());
  scene.EvaluateGains(scans, nullptr, {}, gains, nullptr);
  return gains;
}

bool Covers(const FastGain& gain) {
  return gain.feasibility == Feasibility::kFeasible && gain.covered_targets > 0;
}

}  // namespace

std::vector<Measurement> RandomScans(const CoverageScene& scene, size_t count, uint64_t seed,
                                     int64_t* tried) {
  const SearchSpace space(ThesisDomain());
  Random random(seed);
  std::vector<Measurement> result;
  int64_t drawn = 0;
  while (result.size() < count) {
    std::vector<Measurement> batch;
    for (int i = 0; i < 256; ++i) batch.push_back(space.ToMeasurement(RandomPoint(space, random)));
    const std::vector<FastGain> gains = Gains(scene, batch);
    for (size_t i = 0; i < batch.size() && result.size() < count; ++i, ++drawn) {
      if (Covers(gains[i])) result.push_back(batch[i]);
    }
  }
  if (tried != nullptr) *tried = drawn;
  return result;
}

std::vector<Measurement> ClimbedScans(const CoverageScene& scene, size_t count, int stages,
                                      uint64_t seed) {
  constexpr int kBatch = 32;
  constexpr double kFirstStep = 0.12, kLastStep = 0.01;
  const SearchSpace space(ThesisDomain());
  std::vector<Measurement> result(count);
  ParallelFor(2, count, [&](size_t i) {
    Random random(DeriveSeed(seed, i));
    const int batches = 1 + static_cast<int>(i) % stages;
    Point best;
    int best_gain = 0;
    for (int b = 0; best.empty() || b < batches; ++b) {
      const double step =
          kFirstStep + (kLastStep - kFirstStep) * std::min(1.0, b / static_cast<double>(stages));
      std::vector<Point> points;
      std::vector<Measurement> scans;
      for (int k = 0; k < kBatch; ++k) {
        points.push_back(best.empty() ? RandomPoint(space, random)
                                      : Step(space, best, step, random));
        scans.push_back(space.ToMeasurement(points.back()));
      }
      const std::vector<FastGain> gains = Gains(scene, scans);
      for (int k = 0; k < kBatch; ++k) {
        if (!Covers(gains[k]) || gains[k].covered_targets <= best_gain) continue;
        best = points[k];
        best_gain = gains[k].covered_targets;
      }
    }
    result[i] = space.ToMeasurement(best);
  });
  return result;
}

std::vector<Measurement> GreedyPlanScans(const CoverageScene& scene, double goal,
                                         int64_t evaluations_per_scan, int64_t seed) {
  SceneGainModel gain_model(scene);
  PlannerRequest request;
  request.domain = ThesisDomain();
  request.goal.coverage = goal;
  request.strategy = "greedy-pso-1";
  request.seed = seed;
  request.evaluations_per_scan = evaluations_per_scan;
  auto plan = MakePlan(gain_model, request);
  if (!plan.ok()) Fail("greedy plan", std::string(plan.status().message()));
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : plan->scans) scans.push_back(scan.measurement);
  return scans;
}

std::vector<Measurement> Perturbed(const CoverageScene& scene,
                                   const std::vector<Measurement>& scans, size_t count, double step,
                                   uint64_t seed) {
  const SearchSpace space(ThesisDomain());
  Random random(seed);
  std::vector<Measurement> result;
  while (result.size() < count) {
    std::vector<Measurement> batch;
    for (int i = 0; i < 256; ++i) {
      const Measurement& from = scans[random.Below(static_cast<int64_t>(scans.size()))];
      batch.push_back(space.ToMeasurement(Step(space, space.ToUnit(from), step, random)));
    }
    const std::vector<FastGain> gains = Gains(scene, batch);
    for (size_t i = 0; i < batch.size() && result.size() < count; ++i) {
      if (Covers(gains[i])) result.push_back(batch[i]);
    }
  }
  return result;
}

std::string Describe(const Measurement& m) {
  constexpr double kDeg = 180 / std::numbers::pi;
  return absl::StrFormat(
      "d_c %.4f m, tau %.3f deg, phi_c %.3f deg, theta_c %.3f deg, alpha %.3f deg, beta %.3f deg, "
      "gamma %.3f deg, dy %.4f m, dz %.4f m",
      m.camera_distance_m, kDeg * m.triangulation_angle_rad, kDeg * m.camera_azimuth_rad,
      kDeg * m.camera_polar_rad, kDeg * m.part_alpha_rad, kDeg * m.part_beta_rad,
      kDeg * m.part_gamma_rad, m.offset_y_m, m.offset_z_m);
}

}  // namespace sightline::bench
