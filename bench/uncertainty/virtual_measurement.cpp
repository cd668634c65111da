// SPDX-License-Identifier: Apache-2.0
// Virtual measurement of parts whose truth is known: do the predicted uncertainties tell how far
// the results are from it? Whole chain: a part that deviates from its model, scans with errors of
// calibration and detection, triangulation with the nominal setup, inference of the surface at
// targets, fit of features (JCGM 101: propagation of distributions by simulation).
//
// One run draws a part, calibration errors and detection noise. Nothing is linearised: the true
// point is where the true sheet and viewing ray meet the true surface, the measured one is
// triangulated from the noisy image position with the nominal setup, and the estimator works with
// the places at which points were measured. What is predicted comes from the nominal geometry
// alone, as in planning.
#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "core/conformance/conformance.h"
#include "core/conformance/feature.h"
#include "core/part/mesh.h"
#include "core/random/counter_random.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"
#include "core/surface_inference/surface_estimate.h"
#include "core/surface_inference/surface_inference.h"
#include "core/triangulation/triangulation.h"

namespace sightline::bench {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kDegree = std::numbers::pi / 180;

// Nominal surface with coordinates in which it can be unrolled, so that a plane field is laid on
// it.
struct Surface {
  std::string name;
  FeatureGeometry geometry = FeatureGeometry::kPlane;
  Vector3d axis = Vector3d::UnitY();  // cylinder: through axis_point
  Vector3d axis_point = Vector3d::Zero();
  double half_size_m = 0.02;
  std::function<double(const Vector3d&)> signed_distance;  // outside positive
  std::function<Vector2d(const Vector3d&)> unroll;
  std::function<Vector3d(const Vector2d&)> roll;
  std::function<Vector3d(const Vector2d&)> normal;
  std::function<bool(const Vector2d&)> inside;
};

Surface MakePlane() {
  Surface s;
  s.name = "plane 40 x 40 mm";
  s.signed_distance = [](const Vector3d& p) { return p.z(); };
  s.unroll = [](const Vector3d& p) { return Vector2d(p.head<2>()); };
  s.roll = [](const Vector2d& c) { return Vector3d(c.x(), c.y(), 0); };
  s.normal = [](const Vector2d&) { return Vector3d(Vector3d::UnitZ()); };
  s.inside = [](const Vector2d& c) { return c.cwiseAbs().maxCoeff() <= 0.02; };
  return s;
}

// Shaft of radius 20 mm along y, of which 100 degrees and 40 mm are seen from above.
Surface MakeCylinder() {
  constexpr double kRadius = 0.02;
  Surface s;
  s.name = "cylinder, radius 20 mm, 100 deg";
  s.geometry = FeatureGeometry::kCylinder;
  s.axis_point = Vector3d(0, 0, -kRadius);
  s.signed_distance = [](const Vector3d& p) {
    return std::hypot(p.x(), p.z() + kRadius) - kRadius;
  };
  s.unroll = [](const Vector3d& p) {
    return Vector2d(kRadius * std::atan2(p.x(), p.z() + kRadius), p.y());
  };
  s.roll = [](const Vector2d& c) {
    const double a = c.x() / kRadius;
    return Vector3d(kRadius * std::sin(a), c.y(), kRadius * (std::cos(a) - 1));
  };
  s.normal = [](const Vector2d& c) {
    return Vector3d(std::sin(c.x() / kRadius), 0, std::cos(c.x() / kRadius));
  };
  s.inside = [](const Vector2d& c) {
    return std::abs(c.x()) <= kRadius * 50 * kDegree && std::abs(c.y()) <= 0.02;
  };
  return s;
}

// The sloping face of a mesh: an L of three squares, turned 15 degrees about y.
Surface MakeMeshFace() {
  TriangleMesh mesh;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(15 * kDegree, Vector3d::UnitY()).toRotationMatrix();
  const std::array<std::array<double, 2>, 6> corners = {
      {{-20, -20}, {20, -20}, {20, 0}, {0, 0}, {0, 20}, {-20, 20}}};
  for (const auto& c : corners) {
    mesh.positions_m.push_back((turn * Vector3d(1e-3 * c[0], 1e-3 * c[1], 0)).cast<float>());
  }
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}};
  const Vector3d normal = mesh.Normal(0), origin = mesh.Corner(0, 0);
  const Vector3d x = (mesh.Corner(0, 1) - origin).normalized(), y = normal.cross(x);
  Surface s;
  s.name = "L-shaped face of a mesh, 15 deg";
  s.signed_distance = [=](const Vector3d& p) { return normal.dot(p - origin); };
  s.unroll = [=](const Vector3d& p) {
    return Vector2d(x.dot(p - origin) - 0.02, y.dot(p - origin) - 0.02);
  };
  s.roll = [=](const Vector2d& c) {
    return Vector3d(origin + (c.x() + 0.02) * x + (c.y() + 0.02) * y);
  };
  s.normal = [=](const Vector2d&) { return Vector3d(normal); };
  s.inside = [=](const Vector2d& c) {
    const Vector3d p = origin + (c.x() + 0.02) * x + (c.y() + 0.02) * y;
    for (size_t t = 0; t < mesh.triangles.size(); ++t) {
      bool in = true;
      for (int k = 0; k < 3; ++k) {
        const Vector3d a = mesh.Corner(t, k), b = mesh.Corner(t, (k + 1) % 3);
        in = in && normal.dot((b - a).cross(p - a)) >= -1e-9;
      }
      if (in) return true;
    }
    return false;
  };
  return s;
}

// A draw of the Gaussian process with squared-exponential covariance sigma^2 exp(-r^2 / 2 l^2):
// white noise on a grid of spacing l/1.5, smoothed by Gaussians of width l/sqrt(2). Its covariance
// differs from the stated one by 1e-9 of sigma^2 (the grid's first alias) and by less than 1e-6
// through the Gaussians' cut.
class Field {
 public:
  Field(double sigma_m, double length_m, double half_size_m, CounterRandom& random)
      : spacing_m_(length_m / 1.5), width_m_(length_m / std::numbers::sqrt2) {
    side_ = 2 * (static_cast<int>(std::ceil(half_size_m / spacing_m_)) + kReach + 1) + 1;
    // Sum of squared weights is pi s^2 / a^2 for widths s and a spacing a.
    const double scale = sigma_m * spacing_m_ / (width_m_ * std::sqrt(std::numbers::pi));
    weights_.resize(static_cast<size_t>(side_) * static_cast<size_t>(side_));
    for (size_t i = 0; i < weights_.size(); i += 2) {
      const auto pair = random.NormalPair();
      weights_[i] = scale * pair[0];
      if (i + 1 < weights_.size()) weights_[i + 1] = scale * pair[1];
    }
  }

  double At(const Vector2d& place_m) const {
    std::array<double, 2 * kReach + 1> across[2];
    int first[2];
    for (int k = 0; k < 2; ++k) {
      const double place = place_m[k] / spacing_m_;
      const int nearest = static_cast<int>(std::lround(place));
      first[k] = nearest - kReach + side_ / 2;
      if (first[k] < 0 || first[k] + 2 * kReach >= side_) return 0;  // far outside the part
      for (int i = 0; i <= 2 * kReach; ++i) {
        const double d = (place - (nearest - kReach + i)) * spacing_m_ / width_m_;
        across[k][i] = std::exp(-0.5 * d * d);
      }
    }
    double sum = 0;
    for (int i = 0; i <= 2 * kReach; ++i) {
      const double* row = &weights_[static_cast<size_t>(first[1] + i) * static_cast<size_t>(side_) +
                                    static_cast<size_t>(first[0])];
      double line = 0;
      for (int j = 0; j <= 2 * kReach; ++j) line += row[j] * across[0][j];
      sum += across[1][i] * line;
    }
    return sum;
  }

 private:
  static constexpr int kReach = 5;  // at least 4.5 l/1.5 = 3 l, where a Gaussian is 1e-4
  double spacing_m_, width_m_;
  int side_;
  std::vector<double> weights_;
};

// The truth of parts and set-ups, and the estimator's assumptions.
struct Case {
  std::string name;
  bool calibration = true;
  double true_sigma_m = 30e-6, true_length_m = 0;
  double true_offset_m = 0;  // the feature is out of place
  double prior_sigma_m = 30e-6;
};

constexpr double kResolution = 3e-3;  // delta_r of thesis Table 6.5
constexpr double kNoisePx = 0.1;
constexpr double kStep = 0.8e-3;
constexpr int kColumnStride = 6;  // every sixth column: points 0.7 mm apart along the line

// Standard deviations of calibration: what stays after a careful calibration, far below Table 3.2.
VectorXd OwnErrors() {  // of every scan: the rig is set up anew
  VectorXd s = VectorXd::Zero(kTriangulationVariables);
  s.segment<3>(kCameraAlpha).setConstant(2e-5);
  s.segment<3>(kCameraX).setConstant(8e-6);
  s[kSheetTiltX] = s[kSheetTiltZ] = 2e-5;
  s[kSheetOffset] = 8e-6;
  return s;
}
VectorXd CommonErrors() {  // of the same camera in all scans: its intrinsics
  VectorXd s = VectorXd::Zero(kTriangulationVariables);
  s.tail<3>() << 0.2, 0.1, 0.1;  // focal length, principal point [px]
  return s;
}

Rig MakeRig() {
  Rig rig;
  rig.camera.columns_px = rig.camera.rows_px = 640;
  rig.camera.vertical_fov_rad = 15 * kDegree;
  rig.scan_step_m = kStep;
  return rig;
}

std::vector<Measurement> Scans() {
  Measurement a;
  a.camera_distance_m = 0.3;
  a.camera_polar_rad = 0.3;
  a.triangulation_angle_rad = 0.6;
  Measurement b = a;
  b.camera_polar_rad = -0.35;
  b.triangulation_angle_rad = -0.65;
  Measurement c = a;
  c.camera_polar_rad = 0.25;
  c.triangulation_angle_rad = 0.55;
  c.part_gamma_rad = std::numbers::pi / 2;
  return {a, b, c};
}

struct NominalPoint {
  TriangulationSetup setup;  // in part coordinates
  Vector2d image_px;
  Vector3d position_m;
  double slope_m_per_px;  // of the signed distance along the column
};

struct Target {
  Vector3d position_m, normal, across[2];
  Vector2d unrolled_m;
  std::vector<double> noise_m2, calibration_m2;  // per scan, along the normal
  std::vector<std::vector<int>> candidates;      // per scan: points that may be measured near it
};

struct Scene {
  Surface surface;
  double length_scale_m = 0;
  std::vector<std::vector<NominalPoint>> scans;
  std::vector<Target> targets;
};

Eigen::Matrix<double, 1, kTriangulationVariables> NormalDerivatives(const TriangulationSetup& setup,
                                                                    const Vector3d& position_m,
                                                                    const Vector3d& normal) {
  return normal.transpose() * PointDerivatives(setup, ProjectPoint(setup, position_m));
}

// Frame in which a point is lit, in part coordinates.
TriangulationSetup LitSetup(const Rig& rig, const ScanGeometry& g, const Vector3d& position_m) {
  const Vector3d centre = Vector3d::Zero();
  const double stage_m = g.LitStagePosition(PartToWorld(g, centre, position_m, 0));
  return MakeTriangulationSetup(rig.camera, WorldToPart(g, centre, g.camera, stage_m),
                                WorldToPart(g, centre, g.laser, stage_m));
}

// All points that the scan measures of the nominal surface.
std::vector<NominalPoint> NominalPoints(const Rig& rig, const ScanGeometry& g, const Surface& s) {
  std::vector<NominalPoint> points;
  const Vector3d centre = Vector3d::Zero();
  const int frames = static_cast<int>(0.1 / rig.scan_step_m);
  for (int frame = 0; frame < frames; ++frame) {
    const double stage_m = (frame - 0.5 * frames) * rig.scan_step_m;
    const TriangulationSetup setup =
        MakeTriangulationSetup(rig.camera, WorldToPart(g, centre, g.camera, stage_m),
                               WorldToPart(g, centre, g.laser, stage_m));
    for (int column = kColumnStride / 2; column < rig.camera.columns_px; column += kColumnStride) {
      // Secant from the image centre's row along the column; a column that meets nothing of the
      // surface ends outside it.
      Vector2d px(column + 0.5, 0.5 * rig.camera.rows_px);
      double step_px = 1, last = s.signed_distance(Triangulate(setup, px));
      bool found = false;
      for (int i = 0; i < 30 && std::isfinite(step_px) && !found; ++i) {
        px.y() += step_px;
        const double next = s.signed_distance(Triangulate(setup, px));
        if (!std::isfinite(next)) break;
        found = std::abs(next) < 1e-13;
        step_px *= -next / (next - last);
        step_px = std::clamp(step_px, -60.0, 60.0);
        last = next;
      }
      if (!found) continue;
      NominalPoint p{setup, px, Triangulate(setup, px), 0};
      const Vector2d c = s.unroll(p.position_m);
      const Vector3d n = s.normal(c);
      const bool seen = n.dot(setup.camera.origin_m - p.position_m) > 0 &&
                        n.dot(setup.laser.origin_m - p.position_m) > 0 && px.y() >= 0 &&
                        px.y() <= rig.camera.rows_px;
      if (!seen || !s.inside(c)) continue;
      p.slope_m_per_px = (s.signed_distance(Triangulate(setup, px + Vector2d(0, 1e-3))) -
                          s.signed_distance(Triangulate(setup, px - Vector2d(0, 1e-3)))) /
                         2e-3;
      points.push_back(p);
    }
  }
  return points;
}

Scene MakeScene(const Surface& surface, double target_spacing_m) {
  Scene scene;
  scene.surface = surface;
  scene.length_scale_m = CovarianceLengthScale(kResolution);
  const Rig rig = MakeRig();
  const VectorXd own = OwnErrors().cwiseAbs2(), common = CommonErrors().cwiseAbs2();
  std::vector<ScanGeometry> geometries;
  for (const Measurement& m : Scans()) {
    geometries.push_back(MakeScanGeometry(rig, m));
    scene.scans.push_back(NominalPoints(rig, geometries.back(), surface));
  }
  // Places of points move by less than this through errors of calibration and detection.
  constexpr double kMargin = 0.4e-3;
  const double reach_m = 3 * scene.length_scale_m + kMargin;
  const int half = static_cast<int>(0.0165 / target_spacing_m);
  for (int i = -half; i <= half; ++i) {
    for (int j = -half; j <= half; ++j) {
      Target t;
      t.unrolled_m = target_spacing_m * Vector2d(i, j);
      if (!surface.inside(t.unrolled_m)) continue;
      t.position_m = surface.roll(t.unrolled_m);
      t.normal = surface.normal(t.unrolled_m);
      t.across[0] = t.normal.unitOrthogonal();
      t.across[1] = t.normal.cross(t.across[0]);
      for (size_t s = 0; s < geometries.size(); ++s) {
        const auto row =
            NormalDerivatives(LitSetup(rig, geometries[s], t.position_m), t.position_m, t.normal);
        t.noise_m2.push_back(row.head<2>().squaredNorm() * kNoisePx * kNoisePx);
        t.calibration_m2.push_back(row.cwiseAbs2().dot((own + common).transpose()));
        t.candidates.emplace_back();
        for (size_t p = 0; p < scene.scans[s].size(); ++p) {
          if ((scene.scans[s][p].position_m - t.position_m).norm() < reach_m) {
            t.candidates.back().push_back(static_cast<int>(p));
          }
        }
      }
      scene.targets.push_back(t);
    }
  }
  return scene;
}

SurfaceWeights Weights(const Scene& scene, const Target& t, const Case& c,
                       const std::vector<std::vector<Vector3d>>& measured) {
  std::vector<std::vector<SurfaceObservation>> observations(measured.size());
  for (size_t s = 0; s < measured.size(); ++s) {
    for (const int p : t.candidates[s]) {
      const Vector3d d = measured[s][static_cast<size_t>(p)] - t.position_m;
      observations[s].push_back({{t.across[0].dot(d), t.across[1].dot(d)}, t.noise_m2[s]});
    }
  }
  std::vector<double> calibration_m2 = t.calibration_m2;
  if (!c.calibration) std::fill(calibration_m2.begin(), calibration_m2.end(), 0.0);
  return DenseSurfaceWeights({c.prior_sigma_m, scene.length_scale_m}, observations, calibration_m2);
}

// The planner's view: weights and uncertainties from the nominal points.
Feature PredictedFeature(const Scene& scene, const Case& c, std::vector<double>& own_u_m) {
  const Rig rig = MakeRig();
  Feature f;
  f.geometry = scene.surface.geometry;
  f.axis = scene.surface.axis;
  f.axis_point_m = scene.surface.axis_point;
  std::vector<std::vector<Vector3d>> nominal;
  for (const auto& scan : scene.scans) {
    nominal.emplace_back();
    for (const NominalPoint& p : scan) nominal.back().push_back(p.position_m);
  }
  const auto n = static_cast<Eigen::Index>(scene.targets.size());
  for (const Measurement& m : Scans()) {
    const ScanGeometry g = MakeScanGeometry(rig, m);
    ScanSensitivity scan;
    scan.derivatives.resize(n, kCalibrationVariables);
    scan.weights.resize(n);
    scan.covariance.setZero();
    if (c.calibration) {
      scan.covariance.diagonal() = OwnErrors().tail<kCalibrationVariables>().cwiseAbs2();
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      const Target& t = scene.targets[static_cast<size_t>(i)];
      scan.derivatives.row(i) =
          CalibrationDerivatives(LitSetup(rig, g, t.position_m), t.position_m, t.normal);
    }
    f.scans.push_back(scan);
  }
  if (c.calibration) {
    f.common_covariance.diagonal() = CommonErrors().tail<kCalibrationVariables>().cwiseAbs2();
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const Target& t = scene.targets[static_cast<size_t>(i)];
    const SurfaceWeights w = Weights(scene, t, c, nominal);
    for (size_t s = 0; s < f.scans.size(); ++s) f.scans[s].weights[i] = w.of_scans[s];
    FeatureTarget target;
    target.position_m = t.position_m;
    target.normal = t.normal;
    target.uncertainty = w.uncertainty;
    f.targets.push_back(target);
    own_u_m.push_back(w.uncertainty.total_m);
  }
  return f;
}

struct Run {
  VectorXd truth_m, estimate_m;  // deviations at the targets
};

Run Measure(const Scene& scene, const Case& c, uint64_t seed, uint64_t index) {
  const Surface& surface = scene.surface;
  CounterRandom random(seed, index);
  const double length_m = c.true_length_m > 0 ? c.true_length_m : scene.length_scale_m;
  const Field field(c.true_sigma_m, length_m, surface.half_size_m, random);
  const auto truth = [&](const Vector2d& place_m) { return c.true_offset_m + field.At(place_m); };

  const VectorXd own = OwnErrors(), common_sigma = CommonErrors();
  TriangulationErrors common = TriangulationErrors::Zero();
  for (int v = 0; v < kTriangulationVariables; ++v) common[v] = common_sigma[v] * random.Normal();

  std::vector<std::vector<Vector3d>> measured(scene.scans.size());
  std::vector<std::vector<double>> deviations(scene.scans.size());
  for (size_t s = 0; s < scene.scans.size(); ++s) {
    TriangulationErrors errors = TriangulationErrors::Zero();
    for (int v = 0; v < kTriangulationVariables; ++v) errors[v] = own[v] * random.Normal();
    errors += common;
    if (!c.calibration) errors.setZero();
    std::vector<char> needed(scene.scans[s].size(), 0);
    for (const Target& t : scene.targets) {
      for (const int p : t.candidates[s]) needed[static_cast<size_t>(p)] = 1;
    }
    for (size_t i = 0; i < scene.scans[s].size(); ++i) {
      const NominalPoint& p = scene.scans[s][i];
      const auto noise = random.NormalPair();  // drawn for every point: the same in all cases
      measured[s].push_back(Vector3d::Zero());
      deviations[s].push_back(0);
      if (!needed[i]) continue;
      // Image position along the column at which the line is seen: the true setup's point lies on
      // the true surface.
      Vector2d px = p.image_px;
      double slope = p.slope_m_per_px, last = 0, step_px = 0;
      for (int k = 0; k < 8; ++k) {
        const Vector3d x = Triangulate(p.setup, px, errors);
        const double off = surface.signed_distance(x) - truth(surface.unroll(x));
        if (std::abs(off) < 1e-10) break;
        if (k > 0 && off != last) slope = (off - last) / step_px;
        step_px = -off / slope;
        px.y() += step_px;
        last = off;
      }
      px += kNoisePx * Vector2d(noise[0], noise[1]);
      measured[s].back() = Triangulate(p.setup, px);
      deviations[s].back() = surface.signed_distance(measured[s].back());
    }
  }

  const auto n = static_cast<Eigen::Index>(scene.targets.size());
  Run run{VectorXd(n), VectorXd(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Target& t = scene.targets[static_cast<size_t>(i)];
    const SurfaceWeights w = Weights(scene, t, c, measured);
    double h = 0;
    for (size_t s = 0; s < measured.size(); ++s) {
      for (size_t k = 0; k < t.candidates[s].size(); ++k) {
        h += w.of_points[s][k] * deviations[s][static_cast<size_t>(t.candidates[s][k])];
      }
    }
    run.estimate_m[i] = h;
    run.truth_m[i] = truth(t.unrolled_m);
  }
  return run;
}

// Errors over predicted u: what is covered by 1.96 u, and by the interval that the first half of
// the runs gives to the second (JCGM 101).
struct Coverage {
  double predicted_u_m = 0, bias_m = 0, spread_ratio = 0, gum = 0, jcgm101 = 0;
};

// errors[run][k], in units of u[k].
Coverage Cover(const std::vector<std::vector<double>>& errors, const std::vector<double>& u_m) {
  Coverage c;
  std::vector<double> first;
  double count = 0, inside = 0, sum = 0, squares = 0, u = 0, bias = 0;
  for (size_t run = 0; run < errors.size(); ++run) {
    for (size_t k = 0; k < u_m.size(); ++k) {
      const double z = errors[run][k] / u_m[k];
      sum += z, squares += z * z, count += 1;
      bias += errors[run][k];
      inside += std::abs(z) <= 1.96;
      if (run < errors.size() / 2) first.push_back(z);
    }
  }
  const double low = Quantile(first, 0.025), high = Quantile(first, 0.975);
  double second = 0, inside_second = 0;
  for (size_t run = errors.size() / 2; run < errors.size(); ++run) {
    for (size_t k = 0; k < u_m.size(); ++k) {
      const double z = errors[run][k] / u_m[k];
      second += 1;
      inside_second += z >= low && z <= high;
    }
  }
  for (const double x : u_m) u += x;
  c.predicted_u_m = u / static_cast<double>(u_m.size());
  c.bias_m = bias / count;
  c.spread_ratio = std::sqrt(squares / count - sum / count * (sum / count));
  c.gum = inside / count;
  c.jcgm101 = inside_second / second;
  return c;
}

struct Options {
  int runs = 1000;
  int misstated_runs = 300;
  int threads = 2;
  uint64_t seed = 1;
  double spacing_mm = 8;      // of targets; twice the neighbourhood is 7.2 mm
  double correlation_mm = 0;  // of their errors, in the prediction
};

Json RunCase(const Scene& scene, const Case& c, int runs, const Options& options) {
  const Stopwatch watch;
  std::vector<double> own_u_m;
  Feature feature = PredictedFeature(scene, c, own_u_m);
  feature.correlation_length_m = 1e-3 * options.correlation_mm;
  std::vector<Run> results(static_cast<size_t>(runs));
  ParallelFor(options.threads, results.size(),
              [&](size_t i) { results[i] = Measure(scene, c, options.seed, i); });

  Json json;
  json["surface"] = scene.surface.name;
  json["case"] = c.name;
  json["runs"] = runs;
  const auto report = [&](const std::string& measurand,
                          const std::vector<std::vector<double>>& errors,
                          const std::vector<double>& u_m) {
    const Coverage r = Cover(errors, u_m);
    std::printf("  %-22s %8.2f %8.2f %8.3f %8.1f %8.1f\n", measurand.c_str(), 1e6 * r.predicted_u_m,
                1e6 * r.bias_m, r.spread_ratio, 100 * r.gum, 100 * r.jcgm101);
    json[measurand] = {{"predicted_u_um", 1e6 * r.predicted_u_m},
                       {"mean_error_um", 1e6 * r.bias_m},
                       {"spread_over_u", r.spread_ratio},
                       {"covered_gum", r.gum},
                       {"covered_jcgm101", r.jcgm101}};
  };
  std::printf("\n%s; %s; %d runs, %zu targets\n", scene.surface.name.c_str(), c.name.c_str(), runs,
              scene.targets.size());
  std::printf("  %-22s %8s %8s %8s %8s %8s\n", "measurand", "u um", "mean um", "sd/u", "1.96u %",
              "J101 %");

  const size_t n = scene.targets.size();
  std::vector<std::vector<double>> errors;
  for (const Run& run : results) {
    errors.emplace_back();
    for (size_t i = 0; i < n; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      errors.back().push_back(run.estimate_m[k] - run.truth_m[k]);
    }
  }
  const auto predict = [&](Measurand m) {
    const auto u = PredictUncertainty(feature, m, options.seed);
    if (!u.ok()) Fail("virtual_measurement", std::string(u.status().message()));
    return *u;
  };
  const MeasurandUncertainty targets = predict(Measurand::kDeviation);
  report("targets, joint", errors,
         std::vector<double>(targets.target_u_m.begin(), targets.target_u_m.end()));
  report("targets, scans indep.", errors, own_u_m);

  std::vector<std::pair<Measurand, const char*>> fitted = {{Measurand::kPosition, "position"},
                                                           {Measurand::kOrientation, "tilt"}};
  if (feature.geometry == FeatureGeometry::kCylinder)
    fitted.push_back({Measurand::kSize, "diameter"});
  for (const auto& [m, name] : fitted) {
    const MeasurandUncertainty u = predict(m);
    const auto fit = FitFeature(feature, m);
    std::vector<std::vector<double>> e;
    for (const Run& run : results) {
      e.push_back(
          {fit->functionals.row(u.worst).dot(fit->estimator * (run.estimate_m - run.truth_m))});
    }
    report(name, e, {u.u.total_m});
  }
  const MeasurandUncertainty u = predict(Measurand::kForm);
  const auto fit = FitFeature(feature, Measurand::kForm);
  std::vector<std::vector<double>> e;
  for (const Run& run : results) {
    e.push_back({FormDeviation(*fit, run.estimate_m) - FormDeviation(*fit, run.truth_m)});
  }
  report("form", e, {u.u.total_m});
  json["form_bias_perfect_um"] = 1e6 * u.bias_m;
  json["seconds"] = watch.Seconds();
  std::printf("  (form: predicted bias on a perfect feature %.1f um)  %.1f s\n", 1e6 * u.bias_m,
              watch.Seconds());
  return json;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Virtual measurement: coverage of predicted uncertainties");
  using namespace sightline::bench;
  Options options;
  std::string json;
  app.add_option("--runs", options.runs)->check(CLI::Range(10, 1000000));
  app.add_option("--misstated-runs", options.misstated_runs)->check(CLI::Range(10, 1000000));
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 256));
  app.add_option("--seed", options.seed);
  app.add_option("--spacing-mm", options.spacing_mm, "of targets")->check(CLI::Range(1.0, 16.0));
  app.add_option("--correlation-mm", options.correlation_mm, "of their errors, in the prediction")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  PrintMachine();
  std::printf(
      "\nErrors are estimate minus truth. u: predicted; sd/u: spread of the errors over u; 1.96u: "
      "share"
      "\nof truths within 1.96 u of the estimate; J101: within the 95 %% interval of the errors of "
      "the"
      "\nfirst half of the runs, counted in the second half. Targets, joint: with errors that scans"
      "\nshare; scans indep.: as the inference predicts by itself.\n");
  const double spacing_m = 1e-3 * options.spacing_mm;
  Json results = Json::array();
  for (const Surface& surface : {MakePlane(), MakeCylinder(), MakeMeshFace()}) {
    const Scene scene = MakeScene(surface, spacing_m);
    Case noise{.name = "noise only", .calibration = false};
    results.push_back(RunCase(scene, noise, options.runs, options));
    results.push_back(RunCase(scene, Case{.name = "noise and calibration"}, options.runs, options));
  }
  const Scene scene = MakeScene(MakePlane(), spacing_m);
  const double l = scene.length_scale_m;
  const Case misstated[] = {
      {.name = "prior mis-stated: parts deviate 3 times as much", .true_sigma_m = 90e-6},
      {.name = "prior mis-stated: parts deviate a third as much", .true_sigma_m = 10e-6},
      {.name = "prior mis-stated: true length scale half", .true_length_m = 0.5 * l},
      {.name = "prior mis-stated: true length scale double", .true_length_m = 2 * l},
      {.name = "plane 90 um out of place", .true_offset_m = 90e-6},
      {.name = "prior of 10 mm (thesis), plane 90 um out of place",
       .true_offset_m = 90e-6,
       .prior_sigma_m = 10e-3},
  };
  for (const Case& c : misstated) {
    results.push_back(RunCase(scene, c, options.misstated_runs, options));
  }
  WriteResults(json, "virtual_measurement", results);
  return 0;
}
