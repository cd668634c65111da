// SPDX-License-Identifier: Apache-2.0
// How well scans make a surface known: exact inference against the dense reference and the spectral
// law, the fast estimate against exact inference, and what gains are made of.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/physics/angle.h"
#include "coverage_server/uncertainty/calibration_variance.h"
#include "coverage_server/uncertainty/exact_inference.h"
#include "coverage_server/uncertainty/target_priors.h"
#include "coverage_server/uncertainty/uncertainty_gain.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

// A disc of 80 mm with its flat top up.
SceneDefinition Plate() {
  SceneDefinition definition;
  definition.part = Lathe({{0, 0}, {0.04, 0}, {0.04, 0.01}, {0, 0.01}}, 96);
  definition.sampling.spacing_m = 0.004;
  definition.rig.scan_step_m = 0.0005;
  definition.field_directions = 576;
  definition.uncertainty.emplace();
  definition.uncertainty->detection.standard_deviations_px = {0.1};
  return definition;
}

Measurement CloseOverhead(double tau_rad) {
  Measurement m = OverheadMeasurement(tau_rad);
  m.camera_distance_m = 0.2;
  return m;
}

// Targets on the top of the plate, at least `margin_m` from its rim.
std::vector<uint32_t> TopTargets(const CoverageScene& scene, double margin_m) {
  std::vector<uint32_t> result;
  for (size_t t = 0; t < scene.targets().size(); ++t) {
    const Eigen::Vector3f& p = scene.targets().positions_m[t];
    if (scene.targets().normals[t].z() > 0.99f && std::hypot(p.x(), p.y()) < 0.04 - margin_m) {
      result.push_back(static_cast<uint32_t>(t));
    }
  }
  return result;
}

std::vector<TargetUncertainty> Infer(const CoverageScene& scene,
                                     const std::vector<Measurement>& scans,
                                     const std::vector<uint32_t>& targets,
                                     bool after_each_scan = false,
                                     std::span<const float> enough_m = {}) {
  std::vector<std::shared_ptr<const ScanPoints>> points;
  for (const Measurement& scan : scans) {
    const MeasuredScan measured = scene.MeasureForInference(scan, nullptr);
    EXPECT_EQ(measured.feasibility, Feasibility::kFeasible);
    points.push_back(measured.points);
  }
  std::vector<TargetUncertainty> results(targets.size());
  scene.Infer(points, targets, after_each_scan, enough_m, results, nullptr);
  return results;
}

TEST(UncertaintyTest, OnAPlateInferenceFollowsTheSpectralLaw) {
  const auto scene = BuildScene(Plate(), 2);
  ASSERT_NE(scene, nullptr);
  const Measurement scan = CloseOverhead(30 * kRadPerDeg);
  const std::vector<uint32_t> targets = TopTargets(*scene, 0.006);
  ASSERT_GT(targets.size(), 50u);
  const auto exact = Infer(*scene, {scan}, targets);
  // By hand: seen from straight above, a pixel is z/f wide, frames are a step apart, and a shift of
  // the line by a pixel across itself is z / (f tan(tau)) in height.
  const double pixel_m = (0.2 - 0.005) / scene->rig().camera.FocalLengthPx();
  const double sigma_m = 0.1 * pixel_m / std::tan(30 * kRadPerDeg);
  const double density = 1 / (pixel_m * 0.0005) / (sigma_m * sigma_m);
  const double expected_m = UncertaintyAtDensity(scene->priors()->priors[0], density);
  for (size_t i = 0; i < targets.size(); ++i) {
    // Off the image's middle rays lean and pixels differ by their obliquity.
    EXPECT_NEAR(exact[i].uncertainty.total_m / expected_m, 1, 0.12);
    EXPECT_NEAR(exact[i].uncertainty.noise_m / exact[i].uncertainty.total_m, 1, 0.15);
    EXPECT_EQ(exact[i].uncertainty.calibration_m, 0);
  }
}

TEST(UncertaintyTest, InferenceAgreesWithTheDenseReferenceOnTheSamePoints) {
  SceneDefinition definition = Plate();
  // A fiftieth of the deviations of thesis Table 3.2; those of detection are not calibration.
  definition.uncertainty->calibration =
      4e-4 * MakeTriangulationCovariance(kThesisStandardDeviations);
  for (const int v : {kImageX, kImageY}) definition.uncertainty->calibration(v, v) = 0;
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  const std::vector<Measurement> scans = {CloseOverhead(30 * kRadPerDeg),
                                          CloseOverhead(-50 * kRadPerDeg)};
  std::vector<uint32_t> targets = TopTargets(*scene, 0);
  targets.resize(std::min<size_t>(targets.size(), 12));
  const auto results = Infer(*scene, scans, targets);
  const SurfacePrior& prior = scene->priors()->priors[0];
  for (size_t i = 0; i < targets.size(); ++i) {
    const Eigen::Vector3f place = scene->targets().positions_m[targets[i]];
    const Eigen::Vector3f normal = scene->targets().normals[targets[i]];
    const Eigen::Vector3f u = normal.cross(Eigen::Vector3f::UnitX()).normalized();
    const Eigen::Vector3f v = normal.cross(u);
    std::vector<std::vector<SurfaceObservation>> observations(scans.size());
    std::vector<double> common;
    for (size_t s = 0; s < scans.size(); ++s) {
      std::vector<MeasurementPoint> points;
      scene->EvaluateExact(scans[s], &points, nullptr);
      const ScanGeometry g = MakeScanGeometry(scene->rig(), scans[s]);
      const auto setup_at = [&](const Eigen::Vector3d& p) {
        const double stage = g.LitStagePosition(PartToWorld(g, scene->part_centre_m(), p, 0));
        return MakeTriangulationSetup(scene->rig().camera,
                                      WorldToPart(g, scene->part_centre_m(), g.camera, stage),
                                      WorldToPart(g, scene->part_centre_m(), g.laser, stage));
      };
      for (const MeasurementPoint& p : points) {
        const Eigen::Vector3f d = p.position_m - place;
        if (d.norm() > prior.neighbourhood_m() ||
            p.normal.dot(normal) < std::cos(30 * kRadPerDeg)) {
          continue;
        }
        // Propagation by core/triangulation, not by the closed form of the scan's points.
        TriangulationCovariance covariance = TriangulationCovariance::Zero();
        covariance(kImageX, kImageX) = covariance(kImageY, kImageY) = 0.01;
        const TriangulationSetup setup = setup_at(p.position_m.cast<double>());
        const auto j = PointDerivatives(setup, ProjectPoint(setup, p.position_m.cast<double>()));
        const Eigen::RowVectorXd along = normal.cast<double>().transpose() * j;
        observations[s].push_back({{d.dot(u), d.dot(v)}, along * covariance * along.transpose()});
      }
      const TriangulationSetup setup = setup_at(place.cast<double>());
      const auto j = PointDerivatives(setup, ProjectPoint(setup, place.cast<double>()));
      const Eigen::RowVectorXd along = normal.cast<double>().transpose() * j;
      common.push_back(along * scene->uncertainty()->calibration * along.transpose());
    }
    const SurfaceUncertainty dense = DenseSurfaceUncertainty(prior, observations, common);
    EXPECT_NEAR(results[i].uncertainty.total_m / dense.total_m, 1, 0.01);
    EXPECT_NEAR(results[i].uncertainty.calibration_m / dense.calibration_m, 1, 0.02);
    EXPECT_EQ(results[i].points,
              static_cast<int32_t>(observations[0].size() + observations[1].size()));
  }
}

TEST(UncertaintyTest, ScansAddUpAndOrderDoesNotMatter) {
  const auto scene = BuildScene(Plate(), 2);
  ASSERT_NE(scene, nullptr);
  const std::vector<uint32_t> targets = TopTargets(*scene, 0);
  const Measurement a = CloseOverhead(30 * kRadPerDeg), b = CloseOverhead(-50 * kRadPerDeg);
  const auto ab = Infer(*scene, {a, b}, targets, true), ba = Infer(*scene, {b, a}, targets, true);
  const auto only_a = Infer(*scene, {a}, targets);
  for (size_t i = 0; i < targets.size(); ++i) {
    EXPECT_NEAR(ab[i].uncertainty.total_m / ba[i].uncertainty.total_m, 1, 1e-6);
    ASSERT_EQ(ab[i].after_each_scan_m.size(), 2u);
    EXPECT_FLOAT_EQ(ab[i].after_each_scan_m[0], static_cast<float>(only_a[i].uncertainty.total_m));
    EXPECT_LT(ab[i].after_each_scan_m[1], ab[i].after_each_scan_m[0]);
  }
}

TEST(UncertaintyTest, WhereEnoughIsKnownFurtherScansAreLeftOut) {
  const auto scene = BuildScene(Plate(), 2);
  ASSERT_NE(scene, nullptr);
  const std::vector<uint32_t> targets = TopTargets(*scene, 0);
  std::vector<Measurement> scans;
  for (const double tau_deg : {20, 30, -40, 50, -60})
    scans.push_back(CloseOverhead(tau_deg * kRadPerDeg));
  const auto all = Infer(*scene, scans, targets);
  std::vector<float> sorted;
  for (const TargetUncertainty& u : all)
    sorted.push_back(static_cast<float>(u.uncertainty.total_m));
  std::sort(sorted.begin(), sorted.end());
  // Some targets never get there, others with a part of the scans.
  for (const float limit_m : {sorted[sorted.size() / 4], 2 * sorted[sorted.size() / 2]}) {
    const std::vector<float> enough_m(targets.size(), limit_m);
    const auto some = Infer(*scene, scans, targets, false, enough_m);
    int64_t fewer = 0;
    for (size_t i = 0; i < targets.size(); ++i) {
      EXPECT_EQ(some[i].uncertainty.total_m <= limit_m, all[i].uncertainty.total_m <= limit_m);
      EXPECT_GE(some[i].uncertainty.total_m, all[i].uncertainty.total_m * (1 - 1e-6));
      fewer += some[i].points < all[i].points;
    }
    if (limit_m > sorted[sorted.size() / 2]) {
      EXPECT_GT(fewer, static_cast<int64_t>(targets.size() / 2));
    }
  }
}

TEST(UncertaintyTest, CalibrationErrorsDoNotAverageOutWithinAScan) {
  SceneDefinition definition = Plate();
  const double offset_m = 2e-5;
  definition.uncertainty->calibration(kSheetOffset, kSheetOffset) = offset_m * offset_m;
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  const std::vector<uint32_t> targets = TopTargets(*scene, 0.006);
  const Measurement scan = CloseOverhead(30 * kRadPerDeg);
  // The sheet displaced along its normal moves the point of a vertical ray by offset / sin(tau).
  const double expected_m = offset_m / std::sin(30 * kRadPerDeg);
  const auto one = Infer(*scene, {scan}, targets), two = Infer(*scene, {scan, scan}, targets);
  for (size_t i = 0; i < targets.size(); ++i) {
    EXPECT_NEAR(one[i].uncertainty.calibration_m / expected_m, 1, 0.05);
    // Two scans have two independent errors.
    EXPECT_NEAR(two[i].uncertainty.calibration_m / expected_m, std::sqrt(0.5), 0.05);
  }
}

TEST(UncertaintyTest, FastEstimateIsCloseToInference) {
  SceneDefinition definition = Plate();
  definition.uncertainty->calibration(kCameraZ, kCameraZ) = 4e-10;
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  const std::vector<uint32_t> targets = TopTargets(*scene, 0);
  std::vector<Measurement> scans = {CloseOverhead(30 * kRadPerDeg),
                                    CloseOverhead(-50 * kRadPerDeg)};
  scans[1].part_alpha_rad = 0.4;
  for (const Measurement& scan : scans) {
    std::vector<FastInformation> fast(1);
    scene->EvaluateInformation({&scan, 1}, fast, nullptr);
    ASSERT_EQ(fast[0].feasibility, Feasibility::kFeasible);
    const auto exact = Infer(*scene, {scan}, targets);
    std::vector<double> ratios;
    for (size_t i = 0; i < targets.size(); ++i) {
      const auto& informed = fast[0].information.targets;
      const auto place = std::lower_bound(informed.begin(), informed.end(), targets[i]);
      ASSERT_TRUE(place != informed.end() && *place == targets[i]);
      const float density =
          fast[0].information.density[static_cast<size_t>(place - informed.begin())];
      ratios.push_back(UncertaintyAtDensity(scene->priors()->priors[0], density) /
                       exact[i].uncertainty.total_m);
    }
    std::sort(ratios.begin(), ratios.end());
    EXPECT_NEAR(ratios[ratios.size() / 2], 1, 0.03);
    // Up to the rim, where points end anywhere within a spacing of it.
    EXPECT_GT(ratios[ratios.size() / 20], 0.8);
    EXPECT_LT(ratios[ratios.size() - 1 - ratios.size() / 20], 1.25);
  }
}

TEST(UncertaintyTest, CoarseFramesLeaveTheSurfaceUnknownBetweenThem) {
  SceneDefinition definition = Plate();
  definition.rig.scan_step_m = 0.002;
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  const std::vector<uint32_t> targets = TopTargets(*scene, 0.006);
  const Measurement scan = CloseOverhead(30 * kRadPerDeg);
  const auto exact = Infer(*scene, {scan}, targets);
  double mean_square = 0;
  for (const TargetUncertainty& u : exact) {
    EXPECT_GT(u.uncertainty.sampling_m, u.uncertainty.noise_m);
    mean_square +=
        u.uncertainty.sampling_m * u.uncertainty.sampling_m / static_cast<double>(exact.size());
  }
  // Frames are a step apart on a surface that lies in the scan direction.
  EXPECT_NEAR(std::sqrt(mean_square / SamplingVariance(scene->priors()->priors[0], 0.002)), 1, 0.3);
}

TEST(UncertaintyTest, GainsCountWhatScansAddToWhatIsKnown) {
  const auto scene = BuildScene(Plate(), 2);
  ASSERT_NE(scene, nullptr);
  const size_t count = scene->targets().size();
  const Measurement scan = CloseOverhead(30 * kRadPerDeg);
  std::vector<FastInformation> fast(1);
  scene->EvaluateInformation({&scan, 1}, fast, nullptr);
  const ScanInformation& information = fast[0].information;
  ASSERT_GT(information.targets.size(), 100u);
  const SurfacePrior& prior = scene->priors()->priors[0];
  // Every second target needs twice what the scan tells at the first one, the others half of it;
  // one in ten is not toleranced.
  const double told = information.density[information.density.size() / 2];
  std::vector<float> admissible_m(count);
  for (size_t t = 0; t < count; ++t) {
    admissible_m[t] =
        t % 10 == 0
            ? 0
            : static_cast<float>(UncertaintyAtDensity(prior, t % 2 == 0 ? 2 * told : 0.5 * told));
  }
  UncertaintyRequirement requirement{.weights = {.admissible = 1},
                                     .admissible_uncertainty_m = admissible_m,
                                     .relaxed_uncertainty_m = 1e-3,
                                     .known_density = {},
                                     .covered = nullptr,
                                     .target_weights = {}};
  const auto gain = [&](const UncertaintyRequirement& r) {
    UncertaintyGain result;
    scene->EvaluateUncertaintyGains({&scan, 1}, r, {&result, 1}, nullptr);
    return result;
  };
  int64_t reached = 0, judged = 0, relaxed = 0;
  double shares = 0;
  std::vector<float> known(count, 0), weights(count, 0.25f);
  for (size_t i = 0; i < information.targets.size(); ++i) {
    const size_t t = information.targets[i];
    known[t] = information.density[i];
    if (!(admissible_m[t] > 0) || !scene->measurable().Test(t)) continue;
    const double needed = DensityForUncertainty(prior, admissible_m[t]);
    ++judged;
    reached += information.density[i] >= needed;
    relaxed += information.density[i] >= DensityForUncertainty(prior, 1e-3);
    shares += std::min(1.0, information.density[i] / needed);
  }
  ASSERT_GT(reached, judged / 4);
  ASSERT_LT(reached, judged * 3 / 4);
  EXPECT_EQ(gain(requirement).new_targets, reached);
  EXPECT_NEAR(gain(requirement).gain, static_cast<double>(reached), 1e-6);
  // Thesis eq. 6.3 with alpha = 0.4.
  requirement.weights = {.admissible = 0.4, .relaxed = 0.6};
  EXPECT_NEAR(gain(requirement).gain, 0.4 * reached + 0.6 * relaxed, 1e-3);
  requirement.weights = {.information = 1};
  EXPECT_NEAR(gain(requirement).gain, shares, 1e-3 * shares);
  requirement.target_weights = weights;
  EXPECT_NEAR(gain(requirement).gain, 0.25 * shares, 1e-3 * shares);
  requirement.target_weights = {};
  // Thesis eq. 6.1: the scan lowers the penalty of the targets it informs about nearly to zero.
  requirement.weights = {.total_uncertainty = 1};
  EXPECT_NEAR(gain(requirement).gain, static_cast<double>(judged), 0.02 * judged);
  // Known information is not gained again.
  requirement.weights = {.admissible = 1};
  std::vector<float> more = known;
  for (float& density : more) density *= 4;
  requirement.known_density = more;
  EXPECT_EQ(gain(requirement).new_targets, 0);
  EXPECT_EQ(gain(requirement).gain, 0);
  // Twice the scan reaches the targets that need twice as much as it tells at about the first.
  requirement.known_density = known;
  EXPECT_GT(gain(requirement).new_targets, 0);
}

}  // namespace
}  // namespace sightline
