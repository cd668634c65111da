// SPDX-License-Identifier: Apache-2.0
// First-order propagation of the 14 error variables of laser triangulation against Monte Carlo over
// the design space, and whether the second order notices where the first does not suffice.
#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "core/random/counter_random.h"
#include "core/rig/measurement.h"
#include "core/rig/scan_geometry.h"
#include "core/triangulation/triangulation.h"

namespace sightline::bench {
namespace {

struct Options {
  int points = 100;
  int draws = 1000000;
  uint64_t seed = 1;
  int threads = 2;
  std::string json;
};

enum class Errors {
  kIndependent,
  kCorrelated,  // random correlations between all variables
  kCone,        // laser normal drawn on the thesis's cone, propagated as two tilts
  kConeAlone,   // the same without any other error
};

struct Case {
  const char* name;
  double scale;      // of the standard deviations of Table 3.2
  bool near_origin;  // else anywhere in the image, up to the rig's range
  Errors errors;
};
constexpr Case kCases[] = {
    {"Table 3.2, near the origin", 1, true, Errors::kIndependent},
    {"  all variables correlated", 1, true, Errors::kCorrelated},
    {"  laser normal on the cone", 1, true, Errors::kCone},
    {"  laser normal alone, cone", 1, true, Errors::kConeAlone},
    {"  3 x the deviations", 3, true, Errors::kIndependent},
    {"  10 x the deviations", 10, true, Errors::kIndependent},
    {"  30 x the deviations", 30, true, Errors::kIndependent},
    {"Table 3.2, whole image", 1, false, Errors::kIndependent},
    {"  all variables correlated", 1, false, Errors::kCorrelated},
    {"  3 x the deviations", 3, false, Errors::kIndependent},
    {"  10 x the deviations", 10, false, Errors::kIndependent},
    {"  30 x the deviations", 30, false, Errors::kIndependent},
};

double Uniform(CounterRandom& random, double min, double max) {
  return min + (max - min) * random.Uniform();
}

struct Sample {
  TriangulationSetup setup;
  Eigen::Vector2d image_px;
  Eigen::Vector3d point_m;
};

// Measurement of Table 2.1 (poses of the part do not matter to the point in world coordinates), and
// a point of the sheet in view. Near the origin: within a quarter of the camera distance.
Sample RandomSample(CounterRandom& random, bool near_origin) {
  constexpr double kDegree = std::numbers::pi / 180;
  const Rig rig;
  while (true) {  // every other measurement at least has a point in view
    Measurement m;
    m.camera_distance_m = Uniform(random, 0.1, 0.8);
    m.triangulation_angle_rad =
        Uniform(random, 10 * kDegree, 80 * kDegree) * (random.Bits() % 2 == 0 ? 1 : -1);
    m.camera_azimuth_rad = Uniform(random, 0, 360 * kDegree);
    m.camera_polar_rad = Uniform(random, 0, 90 * kDegree);
    const ScanGeometry g = MakeScanGeometry(rig, m);
    Sample sample;
    sample.setup = MakeTriangulationSetup(rig.camera, g.camera, g.laser);
    sample.image_px = {Uniform(random, 0, rig.camera.columns_px),
                       Uniform(random, 0, rig.camera.rows_px)};
    sample.point_m = Triangulate(sample.setup, sample.image_px);
    const double limit_m = near_origin ? 0.25 * m.camera_distance_m : rig.max_range_m;
    const Eigen::Vector3d from =
        near_origin ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : g.camera.origin_m;
    if ((sample.point_m - from).norm() <= limit_m) return sample;  // NaN is not
  }
}

// Correlations of a Wishart matrix: as far from independent as from degenerate.
TriangulationCovariance Correlate(const TriangulationCovariance& diagonal, CounterRandom& random) {
  Eigen::Matrix<double, kTriangulationVariables, 2 * kTriangulationVariables> mixing;
  for (double& value : mixing.reshaped()) value = random.Normal();
  const TriangulationCovariance wishart = mixing * mixing.transpose();
  const TriangulationErrors scale =
      diagonal.diagonal().cwiseQuotient(wishart.diagonal()).cwiseSqrt();
  const TriangulationCovariance covariance = scale.asDiagonal() * wishart * scale.asDiagonal();
  return 0.5 * (covariance + covariance.transpose());
}

struct Outcome {
  double first = 0;       // largest relative difference of a principal standard deviation, Monte
  double second = 0;      // Carlo against first order; against second order
  double flag = 0;        // second_order_difference
  double shift = 0;       // largest second-order mean shift in standard deviations
  double shift_miss = 0;  // largest difference of the mean from that shift in standard deviations
  int64_t missing = 0;    // draws whose ray missed the sheet
};

Outcome Examine(const Case& c, const Options& options, size_t index) {
  CounterRandom place(DeriveSeed(options.seed, c.near_origin ? "near" : "image"), index);
  CounterRandom random(DeriveSeed(options.seed, "draws"), index);
  const Sample sample = RandomSample(place, c.near_origin);

  TriangulationCovariance covariance =
      c.scale * c.scale * MakeTriangulationCovariance(kThesisStandardDeviations);
  const bool cone = c.errors == Errors::kCone || c.errors == Errors::kConeAlone;
  if (c.errors == Errors::kConeAlone) {
    const Eigen::Vector2d tilts = covariance.diagonal().segment<2>(kSheetTiltX);
    covariance.setZero();
    covariance.diagonal().segment<2>(kSheetTiltX) = tilts;
  }
  TriangulationCovariance factor = covariance.cwiseSqrt();
  if (c.errors == Errors::kCorrelated) {
    covariance = Correlate(covariance, place);
    factor = covariance.llt().matrixL();
  }
  const double cone_rad = std::sqrt(2 * covariance(kSheetTiltX, kSheetTiltX));

  Outcome outcome;
  int64_t count = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (int i = 0; i < options.draws; ++i) {
    TriangulationErrors xi;
    for (int k = 0; k < kTriangulationVariables; k += 2) {
      const auto pair = random.NormalPair();
      xi[k] = pair[0];
      xi[k + 1] = pair[1];
    }
    TriangulationErrors errors = factor.triangularView<Eigen::Lower>() * xi;
    if (cone) {
      const double theta = cone_rad * xi[kSheetTiltX];
      const double phi = Uniform(random, -std::numbers::pi, std::numbers::pi);
      errors[kSheetTiltX] = theta * std::cos(phi);
      errors[kSheetTiltZ] = theta * std::sin(phi);
    }
    const Eigen::Vector3d d = Triangulate(sample.setup, sample.image_px, errors) - sample.point_m;
    if (!d.allFinite()) {
      ++outcome.missing;
      continue;
    }
    ++count;
    sum += d;
    squares += d * d.transpose();
  }
  const Eigen::Vector3d mean = sum / count;
  const Eigen::Matrix3d found = (squares - count * mean * mean.transpose()) / (count - 1);

  const PointUncertainty u = PropagateUncertainty(sample.setup, sample.image_px, covariance);
  outcome.flag = u.second_order_difference;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(u.covariance_m2);
  for (int k = 0; k < 3; ++k) {
    // Tilts alone move the point along its ray only.
    if (principal.eigenvalues()[k] < 1e-12 * principal.eigenvalues()[2]) continue;
    const Eigen::Vector3d v = principal.eigenvectors().col(k);
    const double sigma = std::sqrt(v.dot(found * v));
    const double first = std::sqrt(v.dot(u.covariance_m2 * v));
    const double second = std::sqrt(std::max(v.dot(u.second_order_covariance_m2 * v), 0.0));
    outcome.first = std::max(outcome.first, std::abs(sigma / first - 1));
    outcome.second = std::max(outcome.second, std::abs(sigma / second - 1));
    outcome.shift = std::max(outcome.shift, std::abs(v.dot(u.second_order_shift_m)) / first);
    outcome.shift_miss =
        std::max(outcome.shift_miss, std::abs(v.dot(mean - u.second_order_shift_m)) / first);
  }
  return outcome;
}

Json Report(const Case& c, const std::vector<Outcome>& outcomes) {
  int within = 0, flagged = 0, missed = 0;
  int64_t missing = 0;
  double worst_unflagged = 0, worst_flagged = 0, worst_second = 0, shift = 0, shift_miss = 0;
  for (const Outcome& o : outcomes) {
    const bool flag = !(o.flag <= kLargestSecondOrderDifference);
    within += o.first <= 0.05;
    flagged += flag;
    missed += !flag && !(o.first <= 0.05);
    missing += o.missing;
    if (flag) {
      worst_flagged = std::max(worst_flagged, o.first);
      continue;
    }
    worst_unflagged = std::max(worst_unflagged, o.first);
    worst_second = std::max(worst_second, o.second);
    shift = std::max(shift, o.shift);
    shift_miss = std::max(shift_miss, o.shift_miss);
  }
  const auto count = static_cast<double>(outcomes.size());
  std::printf("%-29s %6zu %8.1f %% %8.1f %% %8d %9.2f %% %9.2f %% %11.3g %% %7.3f %8.4f %9lld\n",
              c.name, outcomes.size(), 100 * within / count, 100 * flagged / count, missed,
              100 * worst_unflagged, 100 * worst_second, 100 * worst_flagged, shift, shift_miss,
              static_cast<long long>(missing));
  std::fflush(stdout);
  return {{"case", c.name},
          {"points", outcomes.size()},
          {"within_5_percent", within / count},
          {"flagged", flagged / count},
          {"off_and_not_flagged", missed},
          {"draws_without_point", missing},
          {"worst_unflagged", worst_unflagged},
          {"worst_unflagged_second_order", worst_second},
          {"worst_flagged", worst_flagged},
          {"largest_shift_unflagged_sigma", shift},
          {"largest_shift_difference_unflagged_sigma", shift_miss}};
}

Json TimeOneCall() {
  CounterRandom random(1, 1);
  const Sample sample = RandomSample(random, true);
  const TriangulationCovariance all = MakeTriangulationCovariance(kThesisStandardDeviations);
  const TriangulationCovariance detection =
      MakeTriangulationCovariance({.detection_x_px = 0.2, .detection_y_px = 0.2});
  constexpr int kCalls = 2000;
  double sink = 0;
  const auto microseconds = [&](const auto& call) {
    const double start = OwnCpuSeconds();
    for (int i = 0; i < kCalls; ++i) sink += call();
    return 1e6 * (OwnCpuSeconds() - start) / kCalls;
  };
  const double first =
      microseconds([&] { return FirstOrderCovariance(sample.setup, sample.image_px, all)(0, 0); });
  const double both = microseconds(
      [&] { return PropagateUncertainty(sample.setup, sample.image_px, all).covariance_m2(0, 0); });
  const double two = microseconds([&] {
    return PropagateUncertainty(sample.setup, sample.image_px, detection).covariance_m2(0, 0);
  });
  std::printf(
      "\nCPU us per point: first order %.2f; with second order %.1f, detection errors only "
      "%.1f%s\n",
      first, both, two, std::isfinite(sink) ? "" : " (not finite)");
  return {
      {"first_order", first}, {"with_second_order", both}, {"with_second_order_detection", two}};
}

int Run(const Options& options) {
  PrintMachine();
  std::printf("%d draws per point; statistical error of a standard deviation %.2f %% (1 sigma)\n\n",
              options.draws, 100 / std::sqrt(2.0 * options.draws));
  std::printf("%-29s %6s %10s %10s %8s %11s %11s %13s %7s %8s %9s\n", "", "points", "within 5 %",
              "flagged", "missed", "worst,", "second", "worst,", "shift/", "shift", "draws");
  std::printf("%-29s %6s %10s %10s %8s %11s %11s %13s %7s %8s %9s\n", "", "", "", "", "",
              "unflagged", "order", "flagged", "sigma", "error", "missing");
  Json cases = Json::array();
  for (const Case& c : kCases) {
    std::vector<Outcome> outcomes(options.points);
    ParallelFor(options.threads, outcomes.size(),
                [&](size_t i) { outcomes[i] = Examine(c, options, i); });
    cases.push_back(Report(c, outcomes));
  }
  std::printf(
      "\nwithin 5 %%: Monte Carlo standard deviations along the three principal directions "
      "against the first order.\nmissed: not within 5 %% and not flagged. second order: "
      "worst of the unflagged points against the second order.\nshift: of the mean, largest "
      "of the unflagged points; its error: what the second order leaves of it. draws missing: "
      "their ray did not meet the sheet.\n");
  const Json times = TimeOneCall();
  WriteResults(options.json, "uncertainty_propagation",
               {{"draws", options.draws},
                {"seed", options.seed},
                {"cases", cases},
                {"cpu_us_per_point", times}});
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("First-order propagation of triangulation errors against Monte Carlo");
  sightline::bench::Options options;
  app.add_option("--points", options.points, "random points per case")
      ->check(CLI::Range(1, 1000000));
  app.add_option("--draws", options.draws, "error vectors per point")
      ->check(CLI::Range(100, 100000000));
  app.add_option("--seed", options.seed);
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 64));
  app.add_option("--json", options.json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(options);
}
