// SPDX-License-Identifier: Apache-2.0
#include "core/surface_inference/surface_inference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

namespace sightline {
namespace {

using Scan = std::vector<SurfaceObservation>;
constexpr double kMm = 1e-3;

// Thesis 3.4: an a priori standard deviation of 10 mm; resolution 3 mm.
SurfacePrior Prior() {
  return {.standard_deviation_m = 0.01, .length_scale_m = CovarianceLengthScale(3 * kMm)};
}

// Points a x b apart over more than the neighbourhood, the grid's origin at the offset, those with
// x <= border only, then all turned by `angle_rad` about the target.
Scan Grid(double a_m, double b_m, double noise_m, const Eigen::Vector2d& offset_m,
          double border_m = 1, double angle_rad = 0) {
  Scan scan;
  const double reach = 1.1 * Prior().neighbourhood_m();
  const int columns = static_cast<int>(reach / a_m) + 1;
  const int rows = static_cast<int>(reach / b_m) + 1;
  const double c = std::cos(angle_rad), s = std::sin(angle_rad);
  for (int i = -columns; i <= columns; ++i) {
    for (int j = -rows; j <= rows; ++j) {
      const double x = i * a_m + offset_m.x(), y = j * b_m + offset_m.y();
      if (x <= border_m) scan.push_back({{c * x - s * y, s * x + c * y}, noise_m * noise_m});
    }
  }
  return scan;
}

SurfaceUncertainty Finite(const std::vector<Scan>& scans, const std::vector<double>& common_m2) {
  LocalSurface surface(Prior());
  for (size_t s = 0; s < scans.size(); ++s) surface.AddScan(scans[s], common_m2[s]);
  return surface.Uncertainty();
}

SurfaceUncertainty Dense(const std::vector<Scan>& scans, const std::vector<double>& common_m2) {
  return DenseSurfaceUncertainty(Prior(), scans, common_m2);
}

double SumOfParts(const SurfaceUncertainty& u) {
  return std::hypot(u.noise_m, u.sampling_m, u.calibration_m);
}

// All parts, relative to the total.
void ExpectAgrees(const SurfaceUncertainty& is, const SurfaceUncertainty& should,
                  double tolerance) {
  EXPECT_NEAR(is.total_m, should.total_m, tolerance * should.total_m);
  EXPECT_NEAR(is.noise_m, should.noise_m, tolerance * should.total_m);
  EXPECT_NEAR(is.sampling_m, should.sampling_m, tolerance * should.total_m);
  EXPECT_NEAR(is.calibration_m, should.calibration_m, tolerance * should.total_m);
}

TEST(CovarianceLengthScaleTest, MaximisesCoverageTimesPowerAtTheCutOff) {
  const double resolution = 3 * kMm, cut_off = 1 / (2 * resolution);
  // Thesis eq. 3.22 with sigma_pr = 1 by Simpson's rule.
  const auto objective = [&](double l) {
    const auto spectrum = [&](double f) {
      return l * std::sqrt(2 * std::numbers::pi) *
             std::exp(-2 * std::numbers::pi * std::numbers::pi * f * f * l * l);
    };
    constexpr int kSteps = 400;
    double sum = 0;
    for (int i = 0; i <= kSteps; ++i) {
      const double weight = i == 0 || i == kSteps ? 1 : i % 2 == 1 ? 4 : 2;
      sum += weight * spectrum(cut_off * (2.0 * i / kSteps - 1));
    }
    return spectrum(cut_off) * sum / (3.0 * kSteps);
  };
  double low = 0.1 * resolution, high = resolution;  // golden section
  const double ratio = std::numbers::phi - 1;
  while (high - low > 1e-7 * resolution) {
    const double left = high - ratio * (high - low), right = low + ratio * (high - low);
    (objective(left) > objective(right) ? high : low) =
        objective(left) > objective(right) ? right : left;
  }
  EXPECT_NEAR(CovarianceLengthScale(resolution) / (0.5 * (low + high)), 1, 5e-5);
}

TEST(DenseSurfaceUncertaintyTest, OnePointByHand) {
  const SurfacePrior prior = Prior();
  const double noise = 2 * kMm, common = 1 * kMm, x = 0.7 * kMm;
  const SurfaceUncertainty u = Dense({{{{x, 0}, noise * noise}}}, {common * common});
  const double p2 = prior.standard_deviation_m * prior.standard_deviation_m;
  const double correlation = std::exp(-x * x / (2 * prior.length_scale_m * prior.length_scale_m));
  const double a = p2 * correlation / (p2 + noise * noise + common * common);
  EXPECT_NEAR(u.total_m, std::sqrt(p2 - a * p2 * correlation), 1e-15);
  EXPECT_NEAR(u.noise_m, a * noise, 1e-15);
  EXPECT_NEAR(u.calibration_m, a * common, 1e-15);
  EXPECT_NEAR(u.sampling_m, std::sqrt(p2 * (1 - 2 * a * correlation + a * a)), 1e-15);
}

TEST(DenseSurfaceUncertaintyTest, PartsAddUp) {
  const std::vector<Scan> scans = {Grid(1 * kMm, 0.3 * kMm, 0.05 * kMm, {0.2 * kMm, 0}),
                                   Grid(0.5 * kMm, 0.5 * kMm, 0.1 * kMm, {0, 0}, -0.5 * kMm, 1)};
  const SurfaceUncertainty u = Dense(scans, {1e-10, 4e-8});
  EXPECT_NEAR(SumOfParts(u), u.total_m, 1e-6 * u.total_m);
}

// u by the dense matrices [mm], root mean square, least and largest over places of the grid, from
// a program of its own with 16 x 16 places; and of dense points.
struct Row {
  double a_mm, b_mm, noise_mm, u_mm, least_mm, largest_mm, spectral_mm;
};

TEST(SurfaceInferenceTest, ReproducesTheTableOfGrids) {
  const Row rows[] = {{0.25, 0.25, 0.02, 0.00710, 0.0071, 0.0071, 0.0069},
                      {0.25, 0.25, 0.10, 0.03188, 0.0319, 0.0319, 0.0313},
                      {0.5, 0.3, 0.02, 0.01074, 0.0107, 0.0108, 0.0105},
                      {0.5, 0.3, 0.10, 0.04773, 0.0477, 0.0478, 0.0470},
                      {0.5, 0.5, 0.02, 0.01370, 0.0137, 0.0137, 0.0133},
                      {0.5, 0.5, 0.10, 0.06051, 0.0603, 0.0606, 0.0595},
                      {1, 0.3, 0.02, 0.20762, 0.0324, 0.2936, 0.0145},
                      {1, 0.3, 0.10, 0.21539, 0.0672, 0.2989, 0.0647},
                      {1, 1, 0.02, 0.29799, 0.0465, 0.4159, 0.0255},
                      {1, 1, 0.10, 0.31147, 0.1076, 0.4243, 0.112}};
  for (const Row& row : rows) {
    SCOPED_TRACE(testing::Message() << row.a_mm << " x " << row.b_mm << ", " << row.noise_mm);
    double sum = 0, finite_sum = 0, least = 1, largest = 0;
    const int places = row.a_mm < 1 ? 4 : 16;
    for (int i = 0; i < places; ++i) {
      for (int j = 0; j < places; ++j) {
        const Scan scan =
            Grid(row.a_mm * kMm, row.b_mm * kMm, row.noise_mm * kMm,
                 {row.a_mm * kMm * (i + 0.5) / places, row.b_mm * kMm * (j + 0.5) / places});
        const SurfaceUncertainty finite = Finite({scan}, {0});
        finite_sum += finite.total_m * finite.total_m / (places * places);
        const SurfaceUncertainty u = Dense({scan}, {0});
        ExpectAgrees(finite, u, 0.01);
        sum += u.total_m * u.total_m / (places * places);
        least = std::min(least, u.total_m);
        largest = std::max(largest, u.total_m);
      }
    }
    EXPECT_NEAR(std::sqrt(sum) / kMm, row.u_mm, 0.002 * row.u_mm);
    EXPECT_NEAR(std::sqrt(finite_sum / sum), 1, 0.002);
    EXPECT_NEAR(least / kMm, row.least_mm, 0.01 * row.least_mm);
    EXPECT_NEAR(largest / kMm, row.largest_mm, 0.01 * row.largest_mm);
    const double density =
        1 / (row.a_mm * row.b_mm * row.noise_mm * row.noise_mm * std::pow(kMm, 4));
    EXPECT_NEAR(UncertaintyAtDensity(Prior(), density) / kMm, row.spectral_mm,
                0.006 * row.spectral_mm);
  }
}

TEST(LocalSurfaceTest, AgreesWithDenseAtBordersAndForFewPoints) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  double worst = 0;
  const auto check = [&](const std::vector<Scan>& scans, const std::vector<double>& common) {
    const SurfaceUncertainty is = Finite(scans, common), should = Dense(scans, common);
    ExpectAgrees(is, should, 0.01);
    EXPECT_NEAR(SumOfParts(is), is.total_m, 1e-9 * is.total_m);
    worst = std::max(worst, std::abs(is.total_m / should.total_m - 1));
  };
  for (const double noise : {0.02 * kMm, 0.1 * kMm}) {
    for (const double border_mm : {1.0, 0.5, 0.2, 0.0, -0.25, -0.5, -0.75, -1.0, -1.5, -2.5}) {
      SCOPED_TRACE(testing::Message() << "border " << border_mm << ", noise " << noise);
      for (int i = 0; i < 4; ++i) {
        const Eigen::Vector2d offset = Eigen::Vector2d(uniform(random), uniform(random)) * kMm;
        const double angle = 3 * uniform(random);
        check({Grid(0.5 * kMm, 0.3 * kMm, noise, offset, border_mm * kMm, angle)}, {0});
        check({Grid(1 * kMm, 0.3 * kMm, noise, offset, border_mm * kMm, angle)}, {1e-8});
      }
    }
    for (const int count : {1, 3, 10, 40}) {
      for (const double centre_mm : {0.0, 0.6, 1.2, 2.0, 3.0}) {
        SCOPED_TRACE(testing::Message() << count << " points about " << centre_mm);
        Scan scan;
        for (int i = 0; i < count; ++i) {
          scan.push_back({Eigen::Vector2d(centre_mm + 0.6 * uniform(random), uniform(random)) * kMm,
                          noise * noise});
        }
        check({scan}, {0});
        check({scan}, {1e-6});
      }
    }
  }
  // Several scans of differing noise, common errors and borders.
  for (int i = 0; i < 5; ++i) {
    std::vector<Scan> scans;
    std::vector<double> common;
    for (int s = 0; s < 4; ++s) {
      scans.push_back(Grid(1 * kMm, 0.4 * kMm, (0.07 + 0.05 * uniform(random)) * kMm,
                           {uniform(random) * kMm, 0}, uniform(random) * 2 * kMm,
                           3 * uniform(random)));
      common.push_back(s * 1e-8);
    }
    check(scans, common);
  }
  RecordProperty("worst_relative_difference", std::to_string(worst));
}

TEST(LocalSurfaceTest, LittleNoiseCostsLittleAccuracy) {
  for (const double border_mm : {9.0, 0.2, -0.3, -0.7}) {
    const std::vector<Scan> scans = {
        Grid(0.3 * kMm, 0.3 * kMm, 0.005 * kMm, {0.1 * kMm, 0}, border_mm * kMm)};
    const double should = Dense(scans, {0}).total_m;
    EXPECT_NEAR(Finite(scans, {0}).total_m, should, 0.02 * should) << border_mm;
  }
}

TEST(LocalSurfaceTest, StaysFiniteWithoutNoise) {
  for (const double noise : {1e-6, 1e-9, 1e-150}) {
    LocalSurface surface(Prior());
    const double before = surface.Uncertainty().total_m;
    // All in one place, far from the target.
    const Scan scan(4000, {{2.9 * Prior().length_scale_m, 0}, noise * noise});
    for (int i = 0; i < 20; ++i) surface.AddScan(scan, 0);
    const SurfaceUncertainty u = surface.Uncertainty();
    EXPECT_LE(u.total_m, before);
    EXPECT_GE(u.total_m, 0.999 * before);  // 1 - exp(-2.9^2) / 2
  }
}

TEST(LocalSurfaceTest, ScanByScanTheUncertaintyFalls) {
  // In the manner of thesis Fig. 3.12.
  LocalSurface surface(Prior());
  SurfaceUncertainty before = surface.Uncertainty();
  EXPECT_EQ(before.total_m, 0.01);
  EXPECT_EQ(before.sampling_m, 0.01);
  // Nothing within the neighbourhood, or nowhere: the prior stays.
  surface.AddScan(Scan{{{1.01 * Prior().neighbourhood_m(), 0}, 1e-10}, {{NAN, 0}, 1e-10}}, 1e-8);
  surface.AddScan({}, 1e-8);
  EXPECT_EQ(surface.Uncertainty().total_m, 0.01);
  for (const double border_mm : {-1.5, -0.5, 0.3, 2.0, 9.0}) {
    surface.AddScan(Grid(1 * kMm, 0.3 * kMm, 0.05 * kMm, {0.3 * kMm * border_mm, 0},
                         border_mm * kMm, border_mm),
                    1e-10);
    const SurfaceUncertainty after = surface.Uncertainty();
    EXPECT_LT(after.total_m, before.total_m);
    before = after;
  }
  EXPECT_LT(before.total_m, 0.05 * kMm);
  surface.Clear();
  EXPECT_EQ(surface.Uncertainty().total_m, 0.01);
}

TEST(LocalSurfaceTest, RotationAndOrderDoNotMatter) {
  const Scan a = Grid(1 * kMm, 0.3 * kMm, 0.05 * kMm, {0.2 * kMm, 0}, 0.5 * kMm);
  const Scan b = Grid(0.7 * kMm, 0.4 * kMm, 0.03 * kMm, {0, 0.1 * kMm}, 0.1 * kMm, 2);
  const SurfaceUncertainty u = Finite({a, b}, {1e-9, 4e-9});
  ExpectAgrees(Finite({b, a}, {4e-9, 1e-9}), u, 1e-9);
  for (const double angle : {0.4, 1.3, 2.9}) {
    std::vector<Scan> turned = {a, b};
    for (Scan& scan : turned) {
      for (SurfaceObservation& point : scan) {
        point.place_m = {std::cos(angle) * point.place_m.x() - std::sin(angle) * point.place_m.y(),
                         std::sin(angle) * point.place_m.x() + std::cos(angle) * point.place_m.y()};
      }
    }
    // The basis holds all products up to a total degree, which turning maps onto themselves.
    ExpectAgrees(Finite(turned, {1e-9, 4e-9}), u, 1e-6);
  }
}

TEST(LocalSurfaceTest, CommonErrorsAverageBetweenScansOnly) {
  const double common = 0.2 * kMm;
  const auto scans = [](int count, double spacing_mm) {
    return std::vector<Scan>(
        count, Grid(spacing_mm * kMm, spacing_mm * kMm, 0.01 * kMm, {0.1 * kMm, 0.1 * kMm}));
  };
  const double one = Finite(scans(1, 0.5), {common * common}).calibration_m;
  EXPECT_NEAR(one / common, 1, 0.01);
  // Four times the points of one scan: the noise is halved, the common error is not.
  EXPECT_NEAR(Finite(scans(1, 0.25), {common * common}).calibration_m / common, 1, 0.01);
  EXPECT_LT(Finite(scans(1, 0.25), {0}).noise_m, 0.6 * Finite(scans(1, 0.5), {0}).noise_m);
  for (const int count : {4, 16}) {
    const SurfaceUncertainty u =
        Finite(scans(count, 0.5), std::vector<double>(count, common * common));
    EXPECT_NEAR(u.calibration_m / common, 1 / std::sqrt(count), 0.01);
  }
}

TEST(LocalSurfaceTest, LargerLengthScalesKnowMoreFromTheSamePoints) {
  // In the manner of thesis Fig. 3.9: sigma_pr = 1, sigma_m^2 = 0.03, a few points on a line. A
  // smoother surface is better known between them.
  double before = 2;
  for (const double l : {0.3, 0.6, 1.0, 2.0}) {
    const SurfacePrior prior = {.standard_deviation_m = 1, .length_scale_m = l};
    LocalSurface surface(prior);
    Scan scan;
    for (const double x : {-2.5, -1.5, -0.5, 0.5, 1.5, 2.5}) scan.push_back({{x, 0}, 0.03});
    surface.AddScan(scan, 0);
    const double u = surface.Uncertainty().total_m;
    EXPECT_NEAR(
        u, DenseSurfaceUncertainty(prior, std::vector<Scan>{scan}, std::vector<double>{0}).total_m,
        1e-4);
    EXPECT_LT(u, before);
    before = u;
  }
}

TEST(DensityTest, ClosedFormIsTheIntegralOverTheSpectrum) {
  const SurfacePrior prior = Prior();
  const double l = prior.length_scale_m, pi = std::numbers::pi;
  for (const double density : {1e3, 1e12, 1e15, 1e18, 1e22}) {
    const auto integrand = [&](double f) {
      const double spectrum = prior.standard_deviation_m * prior.standard_deviation_m * 2 * pi * l *
                              l * std::exp(-2 * pi * pi * l * l * f * f);
      return spectrum / (1 + density * spectrum) * 2 * pi * f;
    };
    constexpr int kSteps = 20000;
    const double end = 2.5 / l;  // S has fallen to exp(-123)
    double sum = 0;
    for (int i = 1; i < kSteps; ++i) sum += (i % 2 == 1 ? 4 : 2) * integrand(end * i / kSteps);
    const double u = std::sqrt(sum * end / kSteps / 3);
    EXPECT_NEAR(UncertaintyAtDensity(prior, density) / u, 1, 1e-9) << density;
  }
  EXPECT_EQ(UncertaintyAtDensity(prior, 0), prior.standard_deviation_m);
}

TEST(DensityTest, InverseReturnsTheUncertainty) {
  const SurfacePrior prior = Prior();
  for (const double relative : {1e-100, 1e-9, 1e-4, 0.003, 0.1, 0.5, 0.9, 0.99, 0.9999}) {
    const double u = relative * prior.standard_deviation_m;
    const double density = DensityForUncertainty(prior, u);
    EXPECT_NEAR(UncertaintyAtDensity(prior, density) / u, 1, 1e-12) << relative;
  }
}

TEST(SamplingVarianceTest, MultipliesForCrossedScans) {
  const SurfacePrior prior = Prior();
  const double variance_m2 = prior.standard_deviation_m * prior.standard_deviation_m;
  for (const double spacing_mm : {1.5, 2.0}) {
    double one = 0, both = 0;
    constexpr int kPlaces = 4;
    for (int i = 0; i < kPlaces; ++i) {
      for (int j = 0; j < kPlaces; ++j) {
        const auto lines = [&](int place, double angle) {
          return Grid(spacing_mm * kMm, 0.3 * kMm, 0.02 * kMm,
                      {spacing_mm * kMm * (place + 0.5) / kPlaces, 0}, 1, angle);
        };
        const Scan a = lines(i, 0), b = lines(j, std::numbers::pi / 2);
        one += std::pow(Finite({a}, {0}).sampling_m, 2) / (kPlaces * kPlaces);
        both += std::pow(Finite({a, b}, {0, 0}).sampling_m, 2) / (kPlaces * kPlaces);
      }
    }
    EXPECT_NEAR(std::sqrt(both / (one * one / variance_m2)), 1, 0.12) << spacing_mm;
  }
}

TEST(SamplingVarianceTest, IsThatOfSparseLines) {
  // Mean over the place between lines of points 0.2 mm apart; steps well above l.
  const SurfacePrior prior = Prior();
  for (const double spacing_mm : {1.0, 1.5, 2.0}) {
    double mean = 0;
    constexpr int kPlaces = 16;
    for (int i = 0; i < kPlaces; ++i) {
      const double u = Dense({Grid(spacing_mm * kMm, 0.2 * kMm, 0.02 * kMm,
                                   {spacing_mm * kMm * (i + 0.5) / kPlaces, 0})},
                             {0})
                           .sampling_m;
      mean += u * u / kPlaces;
    }
    const double ratio = std::sqrt(SamplingVariance(prior, spacing_mm * kMm) / mean);
    RecordProperty("ratio_" + std::to_string(spacing_mm), std::to_string(ratio));
    EXPECT_NEAR(ratio, 1, 0.15) << spacing_mm;
  }
  EXPECT_EQ(SamplingVariance(prior, 1), 1e-4);
  EXPECT_LT(SamplingVariance(prior, 0.25 * kMm), 1e-50);
}

// Points so close that they are dense, of the given a = lambda sigma_pr^2 2 pi l^2.
double DenseBorder(double a, double distance_in_l) {
  const SurfacePrior prior = {.standard_deviation_m = 1, .length_scale_m = 1};
  constexpr double kSpacing = 0.1;
  const double noise_variance = 2 * std::numbers::pi / a / (kSpacing * kSpacing);
  std::vector<Scan> scans(1);
  for (double x = distance_in_l - kSpacing / 2; x > -3; x -= kSpacing) {
    for (double y = -29.5 * kSpacing; y < 3; y += kSpacing) {
      scans[0].push_back({{x, y}, noise_variance});
    }
  }
  return DenseSurfaceUncertainty(prior, scans, std::vector<double>{0}).total_m;
}

TEST(BorderUncertaintyTest, AgreesWithDensePoints) {
  const SurfacePrior prior = {.standard_deviation_m = 1, .length_scale_m = 1};
  for (const double a : {1e4, 1e6}) {
    double before = 0;
    for (const double x : {1.0, 0.2, 0.0, -0.5, -1.5}) {
      const double u = BorderUncertainty(prior, a / (2 * std::numbers::pi), x);
      EXPECT_NEAR(u / DenseBorder(a, x), 1, 0.08) << a << " " << x;
      EXPECT_GT(u, before);
      before = u;
    }
  }
}

TEST(BorderUncertaintyTest, GoesFromDenseToThePrior) {
  const SurfacePrior prior = Prior();
  for (const double density : {0.0, 1e3, 1e10, 1e15, 1e18, 1e24}) {
    const double u = UncertaintyAtDensity(prior, density);
    EXPECT_NEAR(BorderUncertainty(prior, density, 1), u, 1e-3 * u);
    EXPECT_NEAR(BorderUncertainty(prior, density, -1), prior.standard_deviation_m, 1e-9);
    double before = u * (1 - 1e-12);
    for (int i = 40; i >= -60; --i) {
      const double now = BorderUncertainty(prior, density, i * 0.1 * kMm);
      EXPECT_GE(now, before);
      before = now;
    }
    EXPECT_LE(before, prior.standard_deviation_m);
  }
}

}  // namespace
}  // namespace sightline
