// SPDX-License-Identifier: Apache-2.0
#include "core/registration/surface_deviation.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <map>

#include "core/inspection/inspection.h"
#include "core/part/part_digest.h"
#include "core/part/part_health.h"
#include "core/registration/deformed_mesh.h"
#include "core/targets/poisson_disk.h"
#include "tests/core/registration/measured_shapes.h"

namespace sightline {
namespace {

// Bump of 1 mm in the middle of a plate of 60 x 60 mm.
double Bump(const Eigen::Vector3d& p) {
  const double r_m = std::hypot(p.x() - 0.03, p.y() - 0.03);
  return 1e-3 * std::exp(-0.5 * r_m * r_m / (0.006 * 0.006));
}

class PlateWithBump : public testing::Test {
 protected:
  PlateWithBump() : plate_(PlateMesh(0.06, 0.06, 1, 1)), index_(plate_) {
    Measurement measurement;
    measurement.camera_distance_m = 0.3;
    measurement.triangulation_angle_rad = 0.5;
    noise_.emplace(Rig{}, measurement, plate_.BoundingBox().center(), UncertaintyModel{});
    sampling_.spacing_m = 0.004;
    targets_ = *SampleTargets(plate_, sampling_);
    priors_.assign(targets_.size(), {0.01, CovarianceLengthScale(0.003)});
  }

  // As the rig would measure it; only where x is below `end_m`.
  IndexedScan Scan(double end_m, uint64_t seed) {
    CounterRandom random(seed, 0);
    std::vector<Eigen::Vector3d> points;
    for (double x = 0.0004; x < end_m; x += 0.0008) {
      for (double y = 0.0004; y < 0.06; y += 0.0008) {
        Eigen::Vector3d p(x, y, 0);
        const double sigma_m = std::sqrt(
            noise_->DetectionVariance(p, Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ()));
        p.z() = Bump(p) + sigma_m * random.Normal();
        points.push_back(p);
      }
    }
    return {ProjectOntoModel(index_, points, {}, nullptr, 0.005, 2), *noise_};
  }

  TriangleMesh plate_;
  SurfaceIndex index_;
  std::optional<ScanNoise> noise_;
  TargetSampling sampling_;
  TargetSet targets_;
  std::vector<SurfacePrior> priors_;
};

TEST_F(PlateWithBump, DeviationIsFoundWithinItsUncertainty) {
  const IndexedScan scan = Scan(0.06, 1);
  const IndexedScan* scans[] = {&scan};
  const auto estimates = EstimateDeviations(targets_, priors_, 0.5, scans, 2);
  ASSERT_EQ(estimates.size(), targets_.size());
  int outside = 0;
  for (size_t t = 0; t < targets_.size(); ++t) {
    const double error_m = estimates[t].mean_m - Bump(targets_.positions_m[t].cast<double>());
    EXPECT_GT(estimates[t].points, 0);
    EXPECT_LT(estimates[t].uncertainty_m, 0.005);
    const Eigen::Vector3f& p = targets_.positions_m[t];
    if (std::max(std::abs(p.x() - 0.03f), std::abs(p.y() - 0.03f)) < 0.026f) {
      EXPECT_LT(estimates[t].uncertainty_m, 3e-4);
    }
    outside += std::abs(error_m) > 2 * estimates[t].uncertainty_m;
  }
  EXPECT_LE(outside, static_cast<int>(0.1 * static_cast<double>(targets_.size())));
}

TEST_F(PlateWithBump, NothingIsKnownWhereNoPointsAre) {
  const IndexedScan scan = Scan(0.03, 1);
  const IndexedScan* scans[] = {&scan};
  const auto estimates = EstimateDeviations(targets_, priors_, 0.5, scans, 2);
  const TargetBits covered = CoveredByPoints(targets_, sampling_, scan, 2);
  int far = 0;
  for (size_t t = 0; t < targets_.size(); ++t) {
    const float x = targets_.positions_m[t].x();
    EXPECT_EQ(covered.Test(t), x < 0.03f + 0.0026f) << x;
    if (x < 0.034f) continue;
    ++far;
    EXPECT_EQ(estimates[t].points, 0);
    EXPECT_EQ(estimates[t].mean_m, 0);
    EXPECT_DOUBLE_EQ(estimates[t].uncertainty_m, 0.01);
  }
  EXPECT_GT(far, 20);
}

TEST_F(PlateWithBump, PointsOfTheOtherSideCoverNothing) {
  const IndexedScan scan = Scan(0.06, 1);
  TargetSet below = targets_;
  for (Eigen::Vector3f& normal : below.normals) normal = -normal;
  EXPECT_EQ(CoveredByPoints(below, sampling_, scan, 1).Count(), 0);
}

TEST_F(PlateWithBump, MoreScansLeaveLessUncertaintyWhateverTheThreads) {
  const IndexedScan first = Scan(0.06, 1), second = Scan(0.03, 2);
  const IndexedScan* scans[] = {&first, &second};
  const auto one = UncertaintiesFromPoints(targets_, priors_, 0.5, scans, 1);
  const auto many = UncertaintiesFromPoints(targets_, priors_, 0.5, scans, 3);
  EXPECT_EQ(one.after_each_scan_m, many.after_each_scan_m);
  for (size_t t = 0; t < targets_.size(); ++t) {
    EXPECT_LE(one.after_each_scan_m[2 * t + 1], one.after_each_scan_m[2 * t] * 1.0001f);
    EXPECT_FLOAT_EQ(static_cast<float>(one.after_all[t].total_m), one.after_each_scan_m[2 * t + 1]);
  }
}

// Noise along the camera's rays moves points of a surface that is seen at a slant sideways; knowing
// the noise, they are put back.
TEST_F(PlateWithBump, PointsArePutBackWhereTheyWereMeasured) {
  Measurement slanted;
  slanted.camera_distance_m = 0.3;
  slanted.camera_polar_rad = 1.0;
  slanted.camera_azimuth_rad = 0.3;
  slanted.triangulation_angle_rad = 0.3;
  const ScanNoise noise(Rig{}, slanted, plate_.BoundingBox().center(), UncertaintyModel{});
  CounterRandom random(11, 0);
  std::vector<Eigen::Vector3d> truth, measured;
  for (int i = 0; i < 500; ++i) {
    truth.emplace_back(0.02 + 0.02 * random.Uniform(), 0.02 + 0.02 * random.Uniform(), 0);
    const Eigen::Matrix3d covariance =
        noise.DetectionCovariance(truth.back(), Eigen::Vector3d::UnitZ());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
    Eigen::Vector3d drawn(random.Normal(), random.Normal(), random.Normal());
    drawn = drawn.cwiseProduct(eigen.eigenvalues().cwiseMax(0).cwiseSqrt());
    measured.push_back(truth.back() + eigen.eigenvectors() * drawn);
  }
  const PointsOnModel raw = ProjectOntoModel(index_, measured, {}, nullptr, 0.02, 1);
  const PointsOnModel put_back = ProjectOntoModel(index_, measured, {}, &noise, 0.02, 1);
  ASSERT_EQ(put_back.positions_m.size(), measured.size());
  double raw_m2 = 0, put_back_m2 = 0;
  for (size_t i = 0; i < measured.size(); ++i) {
    raw_m2 += (raw.positions_m[i].cast<double>() - truth[i]).squaredNorm();
    put_back_m2 += (put_back.positions_m[i].cast<double>() - truth[i]).squaredNorm();
    EXPECT_NEAR(put_back.positions_m[i].z(), 0, 1e-6);
    EXPECT_FLOAT_EQ(put_back.deviations_m[i], raw.deviations_m[i]);
  }
  EXPECT_LT(put_back_m2, 0.1 * raw_m2);
}

TEST_F(PlateWithBump, PointsNearAnotherFaceAreNotSure) {
  const TriangleMesh box = BoxMesh({0, 0, 0}, {0.06f, 0.06f, 0.06f});
  const SurfaceIndex index(box);
  const ScanNoise noise(Rig{},
                        Measurement{.camera_distance_m = 0.3, .triangulation_angle_rad = 0.5},
                        box.BoundingBox().center(), UncertaintyModel{});
  const std::vector<Eigen::Vector3d> points = {{0.03, 0.03, 0.06}, {0.0598, 0.03, 0.06}};
  const PointsOnModel on = ProjectOntoModel(index, points, {}, &noise, 0.005, 1);
  EXPECT_EQ(on.sure, (std::vector<uint8_t>{1, 0}));
}

// A block on a plate, seen from above with noise of 2 mm along the camera's rays: points of the
// plate come to lie higher beside the block's wall, nearer to it than to the plate, where next to
// no noise acts along the normal. Few points are the wall's own. It does not deviate, and may not
// be said to.
TEST_F(PlateWithBump, PointsOfOtherFacesAreNoDeviation) {
  const TriangleMesh mesh = Merged(plate_, BoxMesh({0.02f, 0.0f, -0.001f}, {0.04f, 0.06f, 0.04f}));
  const SurfaceIndex index(mesh);
  const Measurement above{.camera_distance_m = 0.3, .triangulation_angle_rad = 0.3};
  UncertaintyModel model;
  model.detection.standard_deviations_px = {1};
  const ScanNoise noise(Rig{}, above, mesh.BoundingBox().center(), model);
  CounterRandom random(5, 0);
  std::vector<Eigen::Vector3d> points, normals;
  const auto measure = [&](const Eigen::Vector3d& truth, const Eigen::Vector3d& normal) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(
        noise.DetectionCovariance(truth, normal));
    Eigen::Vector3d drawn(random.Normal(), random.Normal(), random.Normal());
    drawn = drawn.cwiseProduct(eigen.eigenvalues().cwiseMax(0).cwiseSqrt());
    points.push_back(truth + eigen.eigenvectors() * drawn);
    normals.push_back(normal);
  };
  for (double y = 0.0002; y < 0.06; y += 0.0004) {
    for (double x = 0.0002; x < 0.06; x += 0.0004) {
      const bool on_block = std::abs(x - 0.03) < 0.01;
      measure({x, y, on_block ? 0.04 : 0}, Eigen::Vector3d::UnitZ());
    }
    for (double z = 0.0002; z < 0.04; z += 0.004) {
      measure({0.02, y, z}, -Eigen::Vector3d::UnitX());
      measure({0.04, y, z}, Eigen::Vector3d::UnitX());
    }
  }
  const IndexedScan scan(ProjectOntoModel(index, points, normals, &noise, 0.005, 2), noise);
  const IndexedScan* scans[] = {&scan};
  const TargetSet targets = *SampleTargets(mesh, sampling_);
  const std::vector<SurfacePrior> priors(targets.size(), {0.002, CovarianceLengthScale(0.008)});
  const auto estimates = EstimateDeviations(targets, priors, 0.5, scans, 2);
  int64_t known = 0;
  for (size_t t = 0; t < targets.size(); ++t) {
    // 4.5 standard deviations: 1 % of false alarms over all of them.
    EXPECT_LE(std::abs(estimates[t].mean_m), 4.5 * estimates[t].uncertainty_m)
        << targets.positions_m[t].transpose() << ", " << estimates[t].points << " points";
    known += estimates[t].points > 0;
  }
  EXPECT_GT(known, 50);
}

TEST_F(PlateWithBump, PointsOffTheModelAreCounted) {
  const std::vector<Eigen::Vector3d> points = {
      {0.03, 0.03, 0.001}, {0.03, 0.03, 0.02}, {0.5, 0.5, 0.5}};
  const PointsOnModel on = ProjectOntoModel(index_, points, {}, nullptr, 0.005, 1);
  ASSERT_EQ(on.positions_m.size(), 1u);
  EXPECT_FLOAT_EQ(on.deviations_m[0], 0.001f);
  EXPECT_EQ(on.off_model, 2);
}

// The plate has two triangles: without refinement it could show no bump.
TEST_F(PlateWithBump, DeformedMeshFollowsTheDeviation) {
  DeviationField field{targets_.positions_m, targets_.normals, {}, sampling_.spacing_m};
  for (const Eigen::Vector3f& p : targets_.positions_m) {
    const double h_m = Bump(p.cast<double>());
    field.deviations_m.push_back(h_m > 2e-5 ? h_m : 0);
  }
  const TriangleMesh deformed = DeformMesh(plate_, field);
  EXPECT_GT(deformed.triangles.size(), 100u);
  const SurfaceIndex index(deformed);
  for (const Eigen::Vector3f& p : targets_.positions_m) {
    Eigen::Vector3d place = p.cast<double>();
    place.z() = Bump(place);
    const auto on = index.Nearest(place, Eigen::Vector3d::Zero(), 0.01);
    ASSERT_TRUE(on);
    EXPECT_LT(on->distance_m, 1.5e-4);
  }
}

TEST(DeformMesh, StaysClosedAndKeepsItsMaterials) {
  TriangleMesh box = BoxMesh({0, 0, 0}, {0.05f, 0.04f, 0.03f});
  box.material_names = {"a", "b"};
  for (size_t t = 0; t < box.triangles.size(); ++t) {
    box.triangle_material.push_back(box.Normal(t).z() > 0.5 ? 1 : 0);
  }
  DeviationField field;
  field.spacing_m = 0.004;
  field.positions_m = {{0.02f, 0.02f, 0.03f}};
  field.normals = {Eigen::Vector3f::UnitZ()};
  field.deviations_m = {0.0005};
  const TriangleMesh deformed = DeformMesh(box, field);
  const PartHealth health = CheckPartHealth(deformed);
  EXPECT_EQ(health.open_edge_count, 0);
  EXPECT_EQ(health.non_manifold_edge_count, 0);
  EXPECT_EQ(health.degenerate_triangle_count, 0);
  ASSERT_EQ(deformed.triangle_material.size(), deformed.triangles.size());
  for (size_t t = 0; t < deformed.triangles.size(); ++t) {
    EXPECT_EQ(deformed.triangle_material[t] == 1, deformed.Normal(t).z() > 0.5);
  }
  EXPECT_NEAR(deformed.BoundingBox().max().z(), 0.0305, 1e-5);
  EXPECT_NEAR(deformed.BoundingBox().min().z(), 0, 1e-9);
}

TEST(DeformMesh, WithoutDeviationsIsTheMesh) {
  const TriangleMesh box = BoxMesh({0, 0, 0}, {0.05f, 0.04f, 0.03f});
  DeviationField field;
  EXPECT_EQ(PartDigestOf(DeformMesh(box, field)), PartDigestOf(box));
  field.positions_m = {{0.02f, 0.02f, 0.03f}};
  field.normals = {Eigen::Vector3f::UnitZ()};
  field.deviations_m = {0};
  EXPECT_EQ(PartDigestOf(DeformMesh(box, field)), PartDigestOf(box));
}

TEST(DeformMesh, StopsRefiningAtTheLimit) {
  const TriangleMesh plate = PlateMesh(0.5, 0.5, 1, 1);
  DeviationField field;
  field.spacing_m = 1e-4;
  field.positions_m = {{0.2f, 0.2f, 0.0f}};
  field.normals = {Eigen::Vector3f::UnitZ()};
  field.deviations_m = {0.0005};
  EXPECT_LT(DeformMesh(plate, field, 500).triangles.size(), 600u);
}

TEST(SurfaceIndex, FindsWhatTryingAllTrianglesFinds) {
  const TriangleMesh mesh = Merged(StepPart(), SphereMesh(0.02, 2));
  const SurfaceIndex index(mesh);
  CounterRandom random(2, 0);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d p(0.12 * random.Uniform() - 0.02, 0.1 * random.Uniform() - 0.02,
                            0.09 * random.Uniform() - 0.02);
    Eigen::Vector3d facing(random.Normal(), random.Normal(), random.Normal());
    if (i % 2 == 0) facing.setZero();
    double nearest_m = 0.03;
    bool any = false;
    for (size_t t = 0; t < mesh.triangles.size(); ++t) {
      if (mesh.Normal(t).dot(facing) < 0) continue;
      // On a fine grid of the triangle; the index may only be nearer.
      for (int a = 0; a <= 40; ++a) {
        for (int b = 0; a + b <= 40; ++b) {
          const Eigen::Vector3d on = mesh.Corner(t, 0) +
                                     (mesh.Corner(t, 1) - mesh.Corner(t, 0)) * a / 40.0 +
                                     (mesh.Corner(t, 2) - mesh.Corner(t, 0)) * b / 40.0;
          const double distance_m = (on - p).norm();
          any = any || distance_m <= 0.03;
          nearest_m = std::min(nearest_m, distance_m);
        }
      }
    }
    const auto found = index.Nearest(p, facing, 0.03);
    if (!found) {
      EXPECT_FALSE(any);
      continue;
    }
    EXPECT_LE(found->distance_m, nearest_m + 1e-9);
    EXPECT_GT(found->distance_m, nearest_m - 3e-3);
    EXPECT_GE(found->normal.dot(facing), 0);
    EXPECT_NEAR((found->position_m - p).norm(), found->distance_m, 1e-12);
  }
}

TEST(SurfaceIndex, NothingWithinReach) {
  const TriangleMesh mesh = StepPart();
  const SurfaceIndex index(mesh);
  EXPECT_FALSE(index.Nearest({1, 1, 1}, Eigen::Vector3d::Zero(), 0.01));
  EXPECT_FALSE(index.Nearest({0.04, 0.03, -0.001}, Eigen::Vector3d::UnitZ(), 0.002));
  EXPECT_TRUE(index.Nearest({0.04, 0.03, -0.001}, -Eigen::Vector3d::UnitZ(), 0.002));
}

}  // namespace
}  // namespace sightline
