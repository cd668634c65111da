// SPDX-License-Identifier: Apache-2.0
#include "core/association/minimum_zone.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/association/chebyshev_fit.h"
#include "core/random/random.h"

namespace sightline {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

MatrixXd RandomMatrix(Random& random, int rows, int columns) {
  MatrixXd m(rows, columns);
  for (double& x : m.reshaped()) x = random.Normal();
  return m;
}

// Least deviation by the theorem of de la Vallee Poussin: the largest one of all sets of columns +
// 1 rows, each of which has a single dependence l: |l . y| / sum |l_i|.
double DeviationOverReferences(const MatrixXd& design, const VectorXd& values) {
  const int n = static_cast<int>(design.rows()), k = static_cast<int>(design.cols()) + 1;
  std::vector<bool> chosen(static_cast<size_t>(n), false);
  std::fill(chosen.begin(), chosen.begin() + k, true);
  double largest = 0;
  do {
    MatrixXd rows(k, k - 1);
    VectorXd y(k);
    for (int i = 0, j = 0; i < n; ++i) {
      if (!chosen[static_cast<size_t>(i)]) continue;
      rows.row(j) = design.row(i);
      y[j++] = values[i];
    }
    const VectorXd l = rows.transpose().fullPivLu().kernel().col(0);
    largest = std::max(largest, std::abs(l.dot(y)) / l.cwiseAbs().sum());
  } while (std::prev_permutation(chosen.begin(), chosen.end()));
  return largest;
}

struct Points {
  std::vector<Vector3d> points, normals;
};

double RangeFrom(const NominalSurface& surface, const std::vector<Vector3d>& points) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Vector3d& p : points) {
    low = std::min(low, SignedDistance(surface, p));
    high = std::max(high, SignedDistance(surface, p));
  }
  return high - low;
}

Points MovedPoints(const Points& points, const Eigen::Isometry3d& motion, double scale) {
  Points moved;
  for (const Vector3d& p : points.points) moved.points.push_back(motion * Vector3d(scale * p));
  for (const Vector3d& n : points.normals) moved.normals.push_back(motion.linear() * n);
  return moved;
}

Eigen::Isometry3d SomeMotion() {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.translate(Vector3d(0.3, -1.2, 0.7));
  motion.rotate(Eigen::AngleAxisd(1.1, Vector3d(1, 2, -0.5).normalized()));
  return motion;
}

// Points of a surface of revolution, raised along its normal by t cos(lobes phi) at every height;
// the distances from the perfect surface alternate between -t and t.
Points Lobed(SurfaceKind kind, int lobes, double t, int around = 48) {
  Points result;
  for (const double z : {-0.010, -0.003, 0.004, 0.010}) {
    for (int k = 0; k < around; ++k) {
      const double phi = 2 * std::numbers::pi * k / around;
      const Vector3d radial(std::cos(phi), std::sin(phi), 0);
      Vector3d normal = radial, point = 0.02 * radial + z * Vector3d::UnitZ();
      if (kind == SurfaceKind::kSphere) {
        const double away = std::sqrt(0.02 * 0.02 - z * z);
        point = away * radial + z * Vector3d::UnitZ();
        normal = point.normalized();
      } else if (kind == SurfaceKind::kCone) {
        const double half = 0.3;
        normal = std::cos(half) * radial - std::sin(half) * Vector3d::UnitZ();
        point = std::tan(half) * (0.05 + z) * radial + (0.05 + z) * Vector3d::UnitZ();
      } else if (kind == SurfaceKind::kTorus) {
        normal = std::cos(100 * z) * radial + std::sin(100 * z) * Vector3d::UnitZ();
        point = 0.02 * radial + 0.004 * normal;
      }
      result.points.push_back(point + t * std::cos(lobes * phi) * normal);
      result.normals.push_back(normal);
    }
  }
  return result;
}

constexpr SurfaceKind kRound[] = {SurfaceKind::kCylinder, SurfaceKind::kCone, SurfaceKind::kSphere,
                                  SurfaceKind::kTorus};

// Points of a surface with deviations at random, such as measurements leave.
Points Rough(SurfaceKind kind, double t, uint64_t seed) {
  Random random(seed);
  Points result = kind == SurfaceKind::kPlane ? Points{} : Lobed(kind, 3, 0, 24);
  if (kind == SurfaceKind::kPlane) {
    for (int i = 0; i < 96; ++i) {
      result.points.emplace_back(0.1 * random.Normal(), 0.06 * random.Normal(), 0);
      result.normals.push_back(Vector3d::UnitZ());
    }
  }
  for (size_t i = 0; i < result.points.size(); ++i) {
    result.points[i] += t * random.Normal() * result.normals[i];
  }
  return result;
}

constexpr SurfaceKind kAll[] = {SurfaceKind::kPlane, SurfaceKind::kCylinder, SurfaceKind::kCone,
                                SurfaceKind::kSphere, SurfaceKind::kTorus};

TEST(ChebyshevFit, LineThroughAParabolaMissesByOneHalf) {
  MatrixXd design(201, 2);
  VectorXd values(201);
  for (int i = 0; i < 201; ++i) {
    const double x = -1 + 0.01 * i;
    design.row(i) << 1, x;
    values[i] = x * x;
  }
  const auto fit = FitChebyshev(design, values);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->deviation, 0.5, 1e-12);
  EXPECT_NEAR(fit->lower_bound, 0.5, 1e-12);
  EXPECT_NEAR(fit->coefficients[0], 0.5, 1e-12);
  EXPECT_NEAR(fit->coefficients[1], 0, 1e-12);
  ASSERT_EQ(fit->active.size(), 3u);
  for (const ActiveRow& active : fit->active) {
    EXPECT_TRUE(active.row == 0 || active.row == 100 || active.row == 200) << active.row;
    EXPECT_NEAR(active.weight, active.row == 100 ? -0.5 : 0.25, 1e-12);
  }
}

TEST(ChebyshevFit, AgreesWithAllReferences) {
  Random random(5);
  for (int set = 0; set < 100; ++set) {
    const int columns = 1 + set % 4;
    const MatrixXd design = RandomMatrix(random, 10, columns);
    const VectorXd values = RandomMatrix(random, 10, 1);
    const auto fit = FitChebyshev(design, values);
    ASSERT_TRUE(fit);
    EXPECT_NEAR(fit->deviation, DeviationOverReferences(design, values), 1e-10);
    EXPECT_NEAR(fit->lower_bound, fit->deviation, 1e-10);
    // The certificate: weights of all signs add up to one, and design' l = 0.
    VectorXd weights = VectorXd::Zero(10);
    for (const ActiveRow& active : fit->active) weights[active.row] = active.weight;
    EXPECT_NEAR(weights.cwiseAbs().sum(), 1, 1e-10);
    EXPECT_LT((design.transpose() * weights).cwiseAbs().maxCoeff(), 1e-10);
  }
}

// Values on few levels over a grid make most steps of the simplex method degenerate.
TEST(ChebyshevFit, EndsOnDegenerateProblems) {
  for (int set = 0; set < 200; ++set) {
    Random random(static_cast<uint64_t>(set));
    MatrixXd design(100, 3);
    VectorXd values(100);
    for (int i = 0; i < 100; ++i) {
      design.row(i) << 1, i % 10, i / 10;
      values[i] = std::floor(3 * random.Uniform());
    }
    const auto fit = FitChebyshev(design, values);
    ASSERT_TRUE(fit) << set;
    EXPECT_NEAR(fit->deviation, fit->lower_bound, 1e-9);
  }
}

TEST(ChebyshevFit, TakesDependentColumnsAndPerfectValues) {
  Random random(2);
  MatrixXd design(30, 4);
  design.leftCols(2) = RandomMatrix(random, 30, 2);
  design.col(2) = design.col(0) - 2 * design.col(1);
  design.col(3).setZero();
  const VectorXd values = RandomMatrix(random, 30, 1);
  const auto fit = FitChebyshev(design, values);
  const auto independent = FitChebyshev(design.leftCols(2), values);
  ASSERT_TRUE(fit && independent);
  EXPECT_NEAR(fit->deviation, independent->deviation, 1e-12);
  EXPECT_NEAR((values - design * fit->coefficients).cwiseAbs().maxCoeff(), fit->deviation, 1e-12);
  const auto perfect = FitChebyshev(design, design.col(0) + design.col(1));
  ASSERT_TRUE(perfect);
  EXPECT_LT(perfect->deviation, 1e-13);
  EXPECT_TRUE(perfect->active.empty());
  // No columns: the deviation is the largest value.
  const auto none = FitChebyshev(MatrixXd(30, 0), values);
  ASSERT_TRUE(none);
  EXPECT_EQ(none->deviation, values.cwiseAbs().maxCoeff());
}

TEST(ChebyshevFit, RefusesWhatIsNoProblem) {
  EXPECT_FALSE(FitChebyshev(MatrixXd(0, 2), VectorXd(0)));
  EXPECT_FALSE(FitChebyshev(MatrixXd::Ones(3, 1), VectorXd::Ones(4)));
  VectorXd values = VectorXd::Ones(3);
  values[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(FitChebyshev(MatrixXd::Ones(3, 1), values));
}

// The width of a point set is that of two parallel planes through three points and one, or through
// two and two (Houle and Toussaint, IEEE Trans. PAMI 10 (1988) 761-765).
TEST(MinimumZone, PlaneIsTheNarrowestOfAllSupportingPairs) {
  for (uint64_t seed = 0; seed < 40; ++seed) {
    Random random(seed);
    Points cloud;
    for (int i = 0; i < 12; ++i) {
      cloud.points.emplace_back(random.Normal(), random.Normal(), 0.05 * random.Normal());
      cloud.normals.push_back(Vector3d::UnitZ());
    }
    double narrowest = std::numeric_limits<double>::infinity();
    const auto try_normal = [&](const Vector3d& normal) {
      if (!(normal.norm() > 1e-12)) return;
      NominalSurface plane;
      plane.kind = SurfaceKind::kPlane;
      plane.axis = normal.normalized();
      narrowest = std::min(narrowest, RangeFrom(plane, cloud.points));
    };
    const std::vector<Vector3d>& p = cloud.points;
    std::vector<Vector3d> edges;
    for (size_t a = 0; a < p.size(); ++a) {
      for (size_t b = a + 1; b < p.size(); ++b) edges.push_back(p[b] - p[a]);
    }
    for (size_t a = 0; a < edges.size(); ++a) {
      for (size_t b = a + 1; b < edges.size(); ++b) try_normal(edges[a].cross(edges[b]));
    }
    const auto zone = FitMinimumZone(SurfaceKind::kPlane, cloud.points, cloud.normals);
    ASSERT_TRUE(zone);
    EXPECT_NEAR(zone->width_m, narrowest, 1e-8 * narrowest) << seed;
  }
}

// cos(m phi), m >= 2, alternates 2 m >= 4 times around: no constant, shift or tilt comes nearer.
TEST(MinimumZone, LobedSurfacesHaveTwiceTheirAmplitude) {
  const double t = 2e-5;
  for (const SurfaceKind kind : kRound) {
    for (const int lobes : {3, 4, 6}) {
      const Points points = Lobed(kind, lobes, t);
      const Points moved = MovedPoints(points, SomeMotion(), 1);
      const auto zone = FitMinimumZone(kind, moved.points, moved.normals);
      ASSERT_TRUE(zone) << SurfaceKindName(kind) << lobes;
      EXPECT_NEAR(zone->width_m, 2 * t, 1e-6 * t) << SurfaceKindName(kind) << " " << lobes;
      EXPECT_LE(zone->gap_m, 1e-6 * zone->width_m);
    }
  }
}

// Vertices of a cube stand out of a sphere, its faces are sunk: both sets have their mean at the
// centre, which is a certificate.
TEST(MinimumZone, SphereOfACube) {
  const double radius = 0.0125, t = 3e-5;
  Points points;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        const int odd = std::abs(x) + std::abs(y) + std::abs(z);
        if (odd == 0) continue;
        const Vector3d n = Vector3d(x, y, z).normalized();
        points.points.push_back((radius + (odd == 3 ? t : odd == 1 ? -t : 0)) * n);
        points.normals.push_back(n);
      }
    }
  }
  const auto zone = FitMinimumZone(SurfaceKind::kSphere, points.points, points.normals);
  ASSERT_TRUE(zone);
  EXPECT_NEAR(zone->width_m, 2 * t, 1e-9 * radius);
  EXPECT_NEAR(zone->surface.radius_m, radius, 1e-9 * radius);
  double outer = 0, inner = 0;
  for (const ZonePoint& point : zone->active) (point.weight > 0 ? outer : inner) += point.weight;
  EXPECT_NEAR(outer, 1, 1e-9);
  EXPECT_NEAR(inner, -1, 1e-9);
}

TEST(MinimumZone, IsNarrowerThanLeastSquaresAndMovesWithThePoints) {
  const double t = 1e-5;
  for (const SurfaceKind kind : kAll) {
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      const Points points = Rough(kind, t, seed);
      const auto gauss = FitSurface(kind, points.points, points.normals);
      const auto zone = FitMinimumZone(kind, points.points, points.normals);
      ASSERT_TRUE(gauss && zone) << SurfaceKindName(kind) << seed;
      EXPECT_NEAR(RangeFrom(zone->surface, points.points), zone->width_m, 1e-12);
      EXPECT_LT(zone->width_m, RangeFrom(*gauss, points.points));
      EXPECT_GT(zone->width_m, t);
      for (const double scale : {1.0, 0.01, 100.0}) {
        const Points moved = MovedPoints(points, SomeMotion(), scale);
        const auto there = FitMinimumZone(kind, moved.points, moved.normals);
        ASSERT_TRUE(there);
        EXPECT_NEAR(there->width_m / scale, zone->width_m, 1e-5 * zone->width_m)
            << SurfaceKindName(kind) << seed;
      }
    }
  }
}

// The weights are the derivatives of the width.
TEST(MinimumZone, WeightsPredictWhatASmallDisplacementDoes) {
  for (const SurfaceKind kind : kAll) {
    Points points = Rough(kind, 1e-5, 77);
    const auto zone = FitMinimumZone(kind, points.points, points.normals);
    ASSERT_TRUE(zone);
    Random random(3);
    double expected_m = 0;
    std::vector<double> moved_m;
    for (size_t i = 0; i < points.points.size(); ++i) moved_m.push_back(1e-9 * random.Normal());
    for (const ZonePoint& active : zone->active) {
      expected_m += active.weight * moved_m[static_cast<size_t>(active.point)];
    }
    for (size_t i = 0; i < points.points.size(); ++i) {
      points.points[i] +=
          moved_m[i] * DistanceGradient(zone->surface, points.points[i], Vector3d::UnitZ());
    }
    const auto there = FitMinimumZone(kind, points.points, points.normals);
    ASSERT_TRUE(there);
    EXPECT_NEAR(there->width_m - zone->width_m, expected_m, 1e-11) << SurfaceKindName(kind);
  }
}

TEST(MinimumZone, RefusesTooFewPoints) {
  const Points points = Lobed(SurfaceKind::kCylinder, 3, 0);
  EXPECT_FALSE(FitMinimumZone(SurfaceKind::kCylinder, std::span(points.points).first(4),
                              std::span(points.normals).first(4)));
  EXPECT_FALSE(FitMinimumZone(SurfaceKind::kFreeform, points.points, points.normals));
}

}  // namespace
}  // namespace sightline
