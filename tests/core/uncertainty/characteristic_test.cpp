// SPDX-License-Identifier: Apache-2.0
// Kinds of characteristics against what least squares gives in closed form.
#include "core/conformance/characteristic.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/association/nominal_surface.h"
#include "core/conformance/conformance.h"

namespace sightline {
namespace {

using Eigen::Vector3d;
constexpr double kNoise = 1e-5;  // of every target by itself [m]

FeatureTarget Target(const Vector3d& position_m, const Vector3d& normal) {
  FeatureTarget t;
  t.position_m = position_m;
  t.normal = normal.normalized();
  t.uncertainty = {kNoise, kNoise, 0, 0};
  return t;
}

// A grid of n x n targets over a square of that side about `centre`, in the plane of u and v.
FeatureElement AddPlane(Feature& f, const Vector3d& centre, const Vector3d& u, const Vector3d& v,
                        double side_m, int n) {
  FeatureElement element;
  element.surface.kind = SurfaceKind::kPlane;
  element.surface.axis = u.cross(v);
  element.surface.point_m = centre;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double a = side_m * ((i + 0.5) / n - 0.5), b = side_m * ((j + 0.5) / n - 0.5);
      element.targets.push_back(static_cast<int>(f.targets.size()));
      f.targets.push_back(Target(centre + a * u + b * v, element.surface.axis));
    }
  }
  return element;
}

// A bore along z of `rings` rings of 24 targets.
FeatureElement AddBore(Feature& f, const Vector3d& centre, double radius_m, double depth_m,
                       int rings) {
  FeatureElement element;
  element.surface.kind = SurfaceKind::kCylinder;
  element.surface.point_m = centre;
  element.surface.radius_m = radius_m;
  for (int k = 0; k < rings; ++k) {
    for (int i = 0; i < 24; ++i) {
      const double angle = 2 * std::numbers::pi * i / 24;
      const Vector3d r(std::cos(angle), std::sin(angle), 0);
      const double z = depth_m * ((k + 0.5) / rings - 0.5);
      element.targets.push_back(static_cast<int>(f.targets.size()));
      f.targets.push_back(Target(centre + radius_m * r + Vector3d(0, 0, z), -r));
    }
  }
  return element;
}

// A sphere about the origin, seen all around.
FeatureElement AddBall(Feature& f, double radius_m, int count) {
  FeatureElement ball;
  ball.surface.kind = SurfaceKind::kSphere;
  ball.surface.radius_m = radius_m;
  for (int k = 0; k < count; ++k) {
    const double z = 1 - (2.0 * k + 1) / count, away = std::sqrt(1 - z * z), angle = 2.399963 * k;
    const Vector3d n(away * std::cos(angle), away * std::sin(angle), z);
    ball.targets.push_back(static_cast<int>(f.targets.size()));
    f.targets.push_back(Target(radius_m * n, n));
  }
  return ball;
}

// A cone of half angle 0.6 rad: rings of 24 targets at 10, 14, ..., 26 mm from the apex. `side` is
// 1 for an outer cone and -1 for a countersink.
FeatureElement AddCone(Feature& f, double side) {
  FeatureElement cone;
  cone.surface.kind = SurfaceKind::kCone;
  cone.surface.point_m = Vector3d(0.1, -0.2, 0.3);
  cone.surface.half_angle_rad = 0.6;
  for (int k = 0; k < 5; ++k) {
    for (int i = 0; i < 24; ++i) {
      const double angle = 2 * std::numbers::pi * i / 24;
      const Vector3d r(std::cos(angle), std::sin(angle), 0);
      const Vector3d along = std::sin(0.6) * r + std::cos(0.6) * Vector3d::UnitZ();
      cone.targets.push_back(static_cast<int>(f.targets.size()));
      f.targets.push_back(Target(cone.surface.point_m + (0.01 + 0.004 * k) * along,
                                 side * (std::cos(0.6) * r - std::sin(0.6) * Vector3d::UnitZ())));
    }
  }
  return cone;
}

// A tube of radius 4 mm around a circle of 30 mm, over an arc of its section: 12 rings of 20.
FeatureElement AddTube(Feature& f, double arc_rad) {
  FeatureElement tube;
  tube.surface.kind = SurfaceKind::kTorus;
  tube.surface.point_m = Vector3d(0.02, 0.01, -0.03);
  tube.surface.radius_m = 0.03;
  tube.surface.tube_radius_m = 0.004;
  for (int k = 0; k < 12; ++k) {
    const double phi = arc_rad * (k + 0.5) / 12;
    for (int i = 0; i < 20; ++i) {
      const double angle = 2 * std::numbers::pi * i / 20;
      const Vector3d r(std::cos(angle), std::sin(angle), 0);
      const Vector3d normal = std::cos(phi) * r + std::sin(phi) * Vector3d::UnitZ();
      tube.targets.push_back(static_cast<int>(f.targets.size()));
      f.targets.push_back(Target(tube.surface.point_m + 0.03 * r + 0.004 * normal, normal));
    }
  }
  return tube;
}

double PredictedU(const Feature& f, const Characteristic& c) {
  const auto fit = FitCharacteristic(f, c);
  EXPECT_TRUE(fit.ok()) << fit.status();
  if (!fit.ok()) return 0;
  const auto predicted = PredictUncertainty(f, fit->fit, fit->measurand);
  EXPECT_TRUE(predicted.ok()) << predicted.status();
  return predicted.ok() ? predicted->u.total_m : 0;
}

TEST(Characteristic, DiameterOfABoreIsTwiceTheMeanOfItsTargets) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kLinearSize;
  c.elements = {AddBore(f, {0.1, 0.2, 0}, 0.01, 0.02, 4)};
  EXPECT_NEAR(PredictedU(f, c), 2 * kNoise / std::sqrt(96), 1e-9);
  c.radius = true;
  EXPECT_NEAR(PredictedU(f, c), kNoise / std::sqrt(96), 1e-9);
}

// The diameter of a sphere seen all around: twice the mean again.
TEST(Characteristic, DiameterOfASphere) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kLinearSize;
  c.elements = {AddBall(f, 0.02, 400)};
  EXPECT_NEAR(PredictedU(f, c), 2 * kNoise / 20, 0.01 * kNoise / 10);
  // Its centre, of which each coordinate is 3/n certain, in the frame of exact coordinates.
  c.kind = ToleranceKind::kPosition;
  c.exact_datum = true;
  EXPECT_NEAR(PredictedU(f, c), kNoise * std::sqrt(3.0 / 400), 0.02 * kNoise * std::sqrt(0.0075));
}

TEST(Characteristic, DistanceOfTwoPlanesIsThatOfTheirMeans) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kLinearDistance;
  c.elements = {AddPlane(f, {0, 0, 0.01}, Vector3d::UnitX(), Vector3d::UnitY(), 0.04, 5),
                AddPlane(f, {0, 0, -0.01}, Vector3d::UnitY(), Vector3d::UnitX(), 0.04, 10)};
  EXPECT_NEAR(PredictedU(f, c), kNoise * std::hypot(1.0 / 5, 1.0 / 10), 1e-10);
}

// The slope of a plane through an n x n grid has the variance 12 sigma^2 / (side^2 (n^2 - 1)) about
// either axis. The fall is the slope times the extent of the targets.
double FallOfGrid(double side_m, int n) {
  const double extent_m = side_m * (n - 1) / n;
  return kNoise * extent_m / side_m * std::sqrt(12.0 / (n * n - 1.0));
}

TEST(Characteristic, OrientationTakesTheUncertaintyOfItsDatum) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kParallelism;
  c.elements = {AddPlane(f, {0, 0, 0.02}, Vector3d::UnitX(), Vector3d::UnitY(), 0.04, 8)};
  c.exact_datum = true;
  // The worst direction is a diagonal.
  const double alone_m = PredictedU(f, c);
  EXPECT_NEAR(alone_m, std::numbers::sqrt2 * FallOfGrid(0.04, 8), 0.02 * alone_m);
  // The datum is as large and as certain: variances add.
  c.exact_datum = false;
  c.datums = {{AddPlane(f, {0, 0, 0}, Vector3d::UnitY(), Vector3d::UnitX(), 0.04, 8)}};
  EXPECT_NEAR(PredictedU(f, c), std::numbers::sqrt2 * alone_m, 1e-3 * alone_m);
  // A datum three times as large with as many targets adds a ninth.
  Feature wide;
  c.elements = {AddPlane(wide, {0, 0, 0.02}, Vector3d::UnitX(), Vector3d::UnitY(), 0.04, 8)};
  c.datums = {{AddPlane(wide, {0, 0, 0}, Vector3d::UnitY(), Vector3d::UnitX(), 0.12, 8)}};
  EXPECT_NEAR(PredictedU(wide, c), std::sqrt(10.0 / 9) * alone_m, 1e-3 * alone_m);
}

// 3-2-1: a hole from two edges of a plate. Across the second edge only the edge's own mean counts.
TEST(Characteristic, PositionOfAHoleInAFullDatumSystem) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kPosition;
  c.elements = {AddBore(f, {0, 0, 0}, 0.005, 0.0001, 4)};
  c.exact_datum = true;
  const double bore_m = PredictedU(f, c);
  c.exact_datum = false;
  const auto faces = [&](int n) {
    return std::vector<std::vector<FeatureElement>>{
        {AddPlane(f, {0, 0, 0.01}, Vector3d::UnitX(), Vector3d::UnitY(), 0.1, n)},
        {AddPlane(f, {-0.05, 0, 0}, Vector3d::UnitY(), -Vector3d::UnitZ(), 0.1, n)},
        {AddPlane(f, {0, -0.05, 0}, Vector3d::UnitX(), Vector3d::UnitZ(), 0.1, n)}};
  };
  c.datums = faces(10);
  const double with_datums_m = PredictedU(f, c);
  EXPECT_GT(with_datums_m, bore_m);
  // With four times the targets the datums' part of the variance is a quarter.
  c.datums = faces(20);
  const double with_more_m = PredictedU(f, c);
  EXPECT_NEAR((with_more_m * with_more_m - bore_m * bore_m) /
                  (with_datums_m * with_datums_m - bore_m * bore_m),
              0.25, 0.06);
}

// A pattern without datums is judged against its own best fit, which leaves less than each hole
// has.
TEST(Characteristic, APatternWithoutDatumsFitsItself) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kPosition;
  for (const double x : {-0.03, 0.03}) {
    for (const double y : {-0.03, 0.03})
      c.elements.push_back(AddBore(f, {x, y, 0}, 0.005, 0.01, 6));
  }
  const double pattern_m = PredictedU(f, c);
  c.exact_datum = true;
  const double single_m = PredictedU(f, c);
  EXPECT_LT(pattern_m, single_m);
  EXPECT_GT(pattern_m, 0.3 * single_m);
  c.exact_datum = false;
  c.elements.resize(1);
  EXPECT_TRUE(absl::IsUnimplemented(FitCharacteristic(f, c).status()));
}

// ISO 2692: with the requirement the radius takes part; it is independent of the centre.
TEST(Characteristic, MaximumMaterialAddsTheUncertaintyOfTheSize) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kPosition;
  c.elements = {AddBore(f, {0, 0, 0}, 0.005, 0.0001, 4)};
  c.exact_datum = true;
  const double place_m = PredictedU(f, c);
  c.material = MaterialRequirement::kMaximum;
  EXPECT_NEAR(PredictedU(f, c), std::hypot(place_m, kNoise / std::sqrt(96)), 1e-3 * place_m);
}

// The form of a profile without datums does not change with where the surface lies: deviations that
// a rigid motion makes are fitted out.
TEST(Characteristic, AProfileWithoutDatumsFitsItself) {
  Feature f;
  Characteristic c;
  c.elements = {AddPlane(f, {0, 0, 0}, Vector3d::UnitX(), Vector3d::UnitY(), 0.04, 8),
                AddPlane(f, {0.02, 0, -0.02}, Vector3d::UnitY(), Vector3d::UnitZ(), 0.04, 8)};
  const auto fit = FitCharacteristic(f, c);
  ASSERT_TRUE(fit.ok()) << fit.status();
  const Vector3d v(1e-5, 2e-5, -3e-5), w(2e-4, -1e-4, 3e-4);
  Eigen::VectorXd h(static_cast<Eigen::Index>(f.targets.size()));
  for (size_t i = 0; i < f.targets.size(); ++i) {
    h[static_cast<Eigen::Index>(i)] = f.targets[i].normal.dot(v + w.cross(f.targets[i].position_m));
  }
  const Eigen::VectorXd left = h - fit->fit.design * (fit->fit.estimator * h);
  EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Characteristic, RunoutIsAboutTheDatumAxis) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kTotalRunout;
  c.elements = {AddBore(f, {0, 0, 0.05}, 0.02, 0.01, 4)};
  c.datums = {{AddBore(f, {0, 0, -0.05}, 0.01, 0.04, 10)}};
  const auto fit = FitCharacteristic(f, c);
  ASSERT_TRUE(fit.ok()) << fit.status();
  // An eccentricity of 10 um is a run-out of 20 um; a larger radius is none.
  Eigen::VectorXd h = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(f.targets.size()));
  for (const int t : c.elements[0].targets) {
    const FeatureTarget& target = f.targets[static_cast<size_t>(t)];
    h[t] = target.normal.dot(Vector3d(1e-5, 0, 0)) + 7e-5;
  }
  EXPECT_NEAR(FormDeviation(fit->fit, h), 2e-5, 1e-9);
  // The same displacement of both is none.
  for (const int t : c.datums[0][0].targets) {
    h[t] = f.targets[static_cast<size_t>(t)].normal.dot(Vector3d(1e-5, 0, 0));
  }
  EXPECT_NEAR(FormDeviation(fit->fit, h), 0, 1e-9);
}

// Value of the first functional for given deviations of all targets [m].
double ValueOf(const CharacteristicFit& fit, const Eigen::VectorXd& h) {
  return (fit.fit.functionals * (fit.fit.estimator * h))(0);
}

// Deviations that a displacement v and rotation w about the origin cause.
Eigen::VectorXd Moved(const Feature& f, const std::vector<int>& targets, const Vector3d& v,
                      const Vector3d& w) {
  Eigen::VectorXd h = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(f.targets.size()));
  for (const int t : targets) {
    const FeatureTarget& target = f.targets[static_cast<size_t>(t)];
    h[t] = target.normal.dot(v + w.cross(target.position_m));
  }
  return h;
}

TEST(Characteristic, RunoutNeedsAnAxis) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kCircularRunout;
  c.elements = {AddBore(f, {0, 0, 0.05}, 0.02, 0.01, 4)};
  c.datums = {{AddPlane(f, {0, 0, 0}, Vector3d::UnitX(), Vector3d::UnitY(), 0.04, 6)}};
  EXPECT_TRUE(absl::IsUnimplemented(FitCharacteristic(f, c).status()));
  c.datums.push_back({AddBore(f, {0, 0, -0.05}, 0.01, 0.04, 10)});
  EXPECT_TRUE(FitCharacteristic(f, c).ok());
}

// Two planes 60 degrees apart. The variances of their slopes across the common edge add up.
TEST(Characteristic, AngleOfTwoPlanes) {
  Feature f;
  Characteristic c;
  c.kind = ToleranceKind::kAngularDistance;
  const Vector3d up(0, 0.5, std::sqrt(0.75));
  c.elements = {AddPlane(f, {0, 0.03, 0}, Vector3d::UnitX(), Vector3d::UnitY(), 0.04, 6),
                AddPlane(f, 0.05 * up, Vector3d::UnitX(), up, 0.06, 9)};
  const auto fit = FitCharacteristic(f, c);
  ASSERT_TRUE(fit.ok()) << fit.status();
  EXPECT_NEAR(fit->reference_length_m, 0.04 * 5 / 6, 1e-9);
  const auto slope_variance = [](double side_m, int n) {
    return 12 * kNoise * kNoise / (side_m * side_m * (n * n - 1));
  };
  const double expected_m =
      fit->reference_length_m * std::sqrt(slope_variance(0.04, 6) + slope_variance(0.06, 9));
  EXPECT_NEAR(PredictedU(f, c), expected_m, 1e-6 * expected_m);
  // Opening the angle by 1e-4 rad counts in full; motions of both planes together do not count.
  const Eigen::VectorXd opened =
      Moved(f, c.elements[1].targets, Vector3d(0, 0, 0), Vector3d(1e-4, 0, 0));
  EXPECT_NEAR(std::abs(ValueOf(*fit, opened)), 1e-4 * fit->reference_length_m, 1e-12);
  std::vector<int> both = c.elements[0].targets;
  both.insert(both.end(), c.elements[1].targets.begin(), c.elements[1].targets.end());
  EXPECT_NEAR(ValueOf(*fit, Moved(f, both, {1e-5, 2e-5, 3e-5}, {2e-4, -1e-4, 3e-4})), 0, 1e-12);
  c.elements[1] = AddPlane(f, {0, 0, 0.1}, Vector3d::UnitX(), Vector3d::UnitY(), 0.04, 6);
  EXPECT_TRUE(absl::IsUnimplemented(FitCharacteristic(f, c).status()));
}

// Along a generatrix at the distance g from the apex, a shift along the axis raises all targets
// alike and opening the half angle by delta raises them by g delta: a regression line over g.
TEST(Characteristic, AngleOfACone) {
  for (const double side : {1.0, -1.0}) {
    Feature f;
    Characteristic c;
    c.kind = ToleranceKind::kAngularSize;
    c.elements = {AddCone(f, side)};
    const auto fit = FitCharacteristic(f, c);
    ASSERT_TRUE(fit.ok()) << fit.status();
    EXPECT_NEAR(fit->reference_length_m, 0.016, 1e-9);
    // The sum of (g - mean)^2 is 24 (4 + 1 + 0 + 1 + 4) (4 mm)^2.
    const double expected_m = 2 * 0.016 * kNoise / (0.004 * std::sqrt(240.0));
    EXPECT_NEAR(PredictedU(f, c), expected_m, 1e-6 * expected_m);
    Eigen::VectorXd h = Moved(f, c.elements[0].targets, {1e-5, 2e-5, 3e-5}, {2e-4, -1e-4, 3e-4});
    EXPECT_NEAR(ValueOf(*fit, h), 0, 1e-12);
    for (size_t i = 0; i < f.targets.size(); ++i) {
      const double g = (f.targets[i].position_m - c.elements[0].surface.point_m).norm();
      h[static_cast<Eigen::Index>(i)] += side * 1e-4 * g;
    }
    EXPECT_NEAR(ValueOf(*fit, h), 2e-4 * 0.016, 1e-12);
  }
}

// The tube of a torus over an arc of its section: the tube's radius raises all targets alike, the
// circle of the tube's centres by cos(phi), and a shift along the axis by sin(phi).
TEST(Characteristic, RadiusOfAFilletIsThatOfATube) {
  for (const double arc_rad : {2 * std::numbers::pi, std::numbers::pi / 2}) {
    Feature f;
    Characteristic c;
    c.kind = ToleranceKind::kLinearSize;
    c.radius = true;
    c.elements = {AddTube(f, arc_rad)};
    Eigen::Matrix3d normal_equations = Eigen::Matrix3d::Zero();
    for (int k = 0; k < 12; ++k) {
      const double phi = arc_rad * (k + 0.5) / 12;
      const Vector3d row(1, std::cos(phi), std::sin(phi));
      normal_equations += 20 * row * row.transpose();
    }
    const double expected_m = kNoise * std::sqrt(normal_equations.inverse()(0, 0));
    EXPECT_NEAR(PredictedU(f, c), expected_m, 1e-6 * expected_m) << arc_rad;
    const auto fit = FitCharacteristic(f, c);
    ASSERT_TRUE(fit.ok()) << fit.status();
    Eigen::VectorXd h = Moved(f, c.elements[0].targets, {1e-5, 2e-5, 3e-5}, {2e-4, -1e-4, 3e-4});
    h.array() += 1e-5;
    EXPECT_NEAR(ValueOf(*fit, h), 1e-5, 1e-11) << arc_rad;
  }
}

struct HandVerdict {
  ToleranceKind kind;
  double zone_m, u_m;
  double acceptance_zone_m;        // at most 0: conformance cannot be proven
  bool good_part_accepted = true;  // as often as not
};

// Judges the characteristic and compares its figures with those found by hand, within 1 %.
void ExpectVerdict(const Feature& f, Characteristic c, const HandVerdict& hand) {
  c.kind = hand.kind;
  const auto verdict = JudgeCharacteristic(f, FitCharacteristic(f, c), c, hand.zone_m);
  ASSERT_TRUE(verdict.ok()) << verdict.status();
  EXPECT_NEAR(verdict->u.total_m, hand.u_m, 0.01 * hand.u_m) << verdict->because;
  EXPECT_NEAR(verdict->acceptance_zone_m, hand.acceptance_zone_m, 0.04 * hand.u_m)
      << verdict->because;
  EXPECT_EQ(verdict->can_be_proven, hand.acceptance_zone_m > 0 && hand.good_part_accepted)
      << verdict->because;
}

// The ten verdicts of docs/plan-for-uncertainty.md, calculated by hand from a noise of 10 um of
// each target and guard bands of 2 u at either limit.
TEST(Characteristic, TenVerdictsByHand) {
  using enum ToleranceKind;
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY();
  Characteristic c;
  c.exact_datum = true;
  Feature bore;
  c.elements = {AddBore(bore, {0, 0, 0}, 0.005, 0.01, 4)};
  ExpectVerdict(bore, c, {kLinearSize, 20e-6, 2.041e-6, 11.84e-6});
  ExpectVerdict(bore, c, {kPosition, 8e-6, 2.415e-6, -1.66e-6});
  c.material = MaterialRequirement::kMaximum;
  ExpectVerdict(bore, c, {kPosition, 18e-6, 2.622e-6, 7.51e-6, false});
  c.material = MaterialRequirement::kNone;

  Feature ball;
  c.elements = {AddBall(ball, 0.02, 400)};
  ExpectVerdict(ball, c, {kLinearSize, 10e-6, 1e-6, 6e-6});

  Feature wall;
  c.elements = {AddPlane(wall, {0, 0, 0.01}, x, y, 0.04, 5),
                AddPlane(wall, {0, 0, -0.01}, y, x, 0.04, 10)};
  ExpectVerdict(wall, c, {kLinearDistance, 10e-6, 2.236e-6, 1.06e-6, false});

  Feature skin;
  c.elements = {AddPlane(skin, {0, 0, 0}, x, y, 0.04, 5)};
  ExpectVerdict(skin, c, {kSurfaceProfile, 60e-6, 10e-6, 20e-6, false});

  Feature wedge;
  const Vector3d up(0, 0.5, std::sqrt(0.75));
  c.elements = {AddPlane(wedge, {0, 0.03, 0}, x, y, 0.04, 6),
                AddPlane(wedge, 0.05 * up, x, up, 0.06, 9)};
  ExpectVerdict(wedge, c, {kAngularDistance, 58.18e-6, 5.333e-6, 36.85e-6});

  Feature countersink;
  c.elements = {AddCone(countersink, -1)};
  ExpectVerdict(countersink, c, {kAngularSize, 15e-6, 5.164e-6, -5.66e-6});

  Feature fillet;
  c.elements = {AddTube(fillet, std::numbers::pi / 2)};
  c.radius = true;
  ExpectVerdict(fillet, c, {kLinearSize, 50e-6, 6.749e-6, 23.0e-6});
  c.radius = false;

  Feature step;
  c.exact_datum = false;
  c.elements = {AddPlane(step, {0, 0, 0.02}, x, y, 0.04, 8)};
  c.datums = {{AddPlane(step, {0, 0, 0}, y, x, 0.04, 8)}};
  ExpectVerdict(step, c, {kParallelism, 20e-6, 7.638e-6, 4.72e-6, false});
}

// Four points lie on many spheres, and five on many cylinders.
TEST(RecogniseSurface, NeedsMorePointsThanParameters) {
  Feature f;
  const FeatureElement ball = AddBall(f, 0.02, 5);
  std::vector<Vector3d> points, normals;
  for (const FeatureTarget& target : f.targets) {
    points.push_back(target.position_m);
    normals.push_back(target.normal);
  }
  EXPECT_EQ(RecogniseSurface(points, normals).kind, ball.surface.kind);
  points.pop_back();
  normals.pop_back();
  EXPECT_EQ(RecogniseSurface(points, normals).kind, SurfaceKind::kFreeform);
}

// Points of one surface of each kind, and normals as facets of 15 degrees have them.
TEST(RecogniseSurface, KnowsEveryKindFromPoints) {
  const Vector3d centre(0.3, -0.2, 0.1);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()));
  for (const SurfaceKind kind : {SurfaceKind::kPlane, SurfaceKind::kCylinder, SurfaceKind::kCone,
                                 SurfaceKind::kSphere, SurfaceKind::kTorus}) {
    NominalSurface truth;
    truth.kind = kind;
    truth.point_m = centre;
    truth.axis = turn * Vector3d::UnitZ();
    truth.radius_m = kind == SurfaceKind::kPlane || kind == SurfaceKind::kCone ? 0 : 0.02;
    truth.tube_radius_m = kind == SurfaceKind::kTorus ? 0.005 : 0;
    truth.half_angle_rad = kind == SurfaceKind::kCone ? 0.4 : 0;
    std::vector<Vector3d> points, normals;
    for (int i = 0; i < 12; ++i) {
      for (int j = 0; j < 8; ++j) {
        // Any point near the surface, moved onto it along the gradient.
        Vector3d p(0.022 * std::cos(0.25 * i), 0.022 * std::sin(0.25 * i), 0.01 + 0.003 * j);
        if (kind == SurfaceKind::kTorus) p.z() = 0.001 * j;
        p = centre + turn * p;
        for (int k = 0; k < 60; ++k) {
          p -= SignedDistance(truth, p) * DistanceGradient(truth, p, truth.axis);
        }
        points.push_back(p);
        const Vector3d n = DistanceGradient(truth, p, truth.axis);
        normals.push_back(
            (Eigen::AngleAxisd(0.1 * std::sin(i + 3 * j), n.unitOrthogonal()) * n).normalized());
      }
    }
    const NominalSurface found = RecogniseSurface(points, normals);
    EXPECT_STREQ(SurfaceKindName(found.kind), SurfaceKindName(kind));
    EXPECT_NEAR(found.radius_m, truth.radius_m, 1e-8);
    EXPECT_NEAR(found.tube_radius_m, truth.tube_radius_m, 1e-8);
    EXPECT_NEAR(found.half_angle_rad, truth.half_angle_rad, 1e-7);
    // Points 30 um off are of no such surface.
    for (size_t i = 0; i < points.size(); ++i) {
      points[i] += (i % 7 == 0 ? 3e-5 : -1e-6) * DistanceGradient(truth, points[i], truth.axis);
    }
    EXPECT_NE(RecogniseSurface(points, normals).kind, kind);
  }
}

}  // namespace
}  // namespace sightline
