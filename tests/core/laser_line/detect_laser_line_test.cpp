// SPDX-License-Identifier: Apache-2.0
#include "core/laser_line/detect_laser_line.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <numbers>

#include "core/laser_line/profile_centre.h"
#include "core/laser_line/ridge_score.h"
#include "core/random/counter_random.h"

namespace sightline {
namespace {

constexpr LaserLineMethod kBoth[] = {LaserLineMethod::kStegerCentreOfGravity,
                                     LaserLineMethod::kGaussianFit};
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Mean over pixel `row` of a Gaussian of height 1 and standard deviation s at `centre`.
double PixelMean(int row, double centre, double s) {
  const auto below = [&](double x) { return std::erf((x - centre) / (s * std::numbers::sqrt2)); };
  return s * std::sqrt(std::numbers::pi / 2) * (below(row + 0.5) - below(row - 0.5));
}

// A Gaussian line whose centre in a column is centre(column), added to the image.
void AddLine(double height, double s, const std::function<double(int)>& centre,
             Image<float>* image) {
  for (int row = 0; row < image->rows_px; ++row) {
    for (int column = 0; column < image->columns_px; ++column) {
      image->At(row, column) += static_cast<float>(height * PixelMean(row, centre(column), s));
    }
  }
}

// Exact, for means up to some hundreds.
double PoissonByInversion(double mean, CounterRandom& random) {
  double uniform = random.Uniform(), probability = std::exp(-mean), k = 0;
  while (uniform >= probability && k < 5000) {
    uniform -= probability;
    probability *= mean / ++k;
  }
  return k;
}

std::vector<LinePoint> Detect(const Image<float>& image, const LaserLineOptions& options,
                              LaserLineMethod method) {
  auto points = DetectLaserLine(image, options, method);
  EXPECT_TRUE(points.ok()) << points.status();
  return points.ok() ? *std::move(points) : std::vector<LinePoint>();
}

struct Spread {
  double mean = 0, deviation = 0;
};
Spread ErrorsOf(const std::vector<LinePoint>& points, const std::function<double(int)>& centre) {
  Spread spread;
  for (const LinePoint& p : points) spread.mean += p.row_px - centre(p.column_px);
  spread.mean /= points.size();
  for (const LinePoint& p : points) {
    spread.deviation += std::pow(p.row_px - centre(p.column_px) - spread.mean, 2);
  }
  spread.deviation = std::sqrt(spread.deviation / (points.size() - 1));
  return spread;
}

TEST(RidgeScore, IsTheSecondDerivativeOfTheSmoothedLine) {
  // A Gaussian line stays one when smoothed: h s / (s^2 + sigma^2)^(3/2), pixels adding 1/12 each.
  for (const double s : {1.5, 3.0}) {
    for (const double sigma : {1.0, 2.0, 5.0}) {
      Image<float> image(64, 64);
      AddLine(
          100, s, [](int) { return 32; }, &image);
      const double variance = s * s + sigma * sigma + 2.0 / 12;
      const double expected = 100 * s / std::pow(variance, 1.5);
      EXPECT_NEAR(RidgeScore(image, sigma).At(32, 32), expected, 0.01 * expected) << s << sigma;
    }
  }
}

TEST(RidgeScore, IsTheSameForEveryDirectionAndZeroForDarkRidgesAndRamps) {
  Image<float> tilted(128, 128), ramp(64, 64), dark(64, 64, 100);
  for (int row = 0; row < 128; ++row) {
    for (int column = 0; column < 128; ++column) {
      const double across = (row - column) / std::numbers::sqrt2;
      tilted.At(row, column) = static_cast<float>(100 * std::exp(-across * across / 8));
    }
  }
  const double variance = 4 + 4 + 1.0 / 12;
  EXPECT_NEAR(RidgeScore(tilted, 2).At(64, 64), 200 / std::pow(variance, 1.5), 0.1);
  AddLine(
      -50, 2, [](int) { return 32; }, &dark);
  for (int row = 0; row < 64; ++row) {
    for (int column = 0; column < 64; ++column) {
      ramp.At(row, column) = static_cast<float>(3 * row + 2 * column);
    }
  }
  EXPECT_EQ(RidgeScore(dark, 2).At(32, 32), 0);
  EXPECT_NEAR(RidgeScore(ramp, 2).At(32, 32), 0, 1e-4);
  EXPECT_NEAR(RidgeScore(Image<float>(64, 64, 250), 2).At(0, 0), 0, 1e-4);
}

TEST(DetectLaserLine, SubPixelPositionsWithoutNoiseHaveNoBias) {
  for (const double s : {1.0, 2.0, 4.0}) {
    const auto centre = [](int column) { return 40 + column / 64.0; };
    Image<float> image(64, 80);
    AddLine(200, s, centre, &image);
    LaserLineOptions options;
    options.ridge_sigma_px = s;
    for (const LaserLineMethod method : kBoth) {
      const auto points = Detect(image, options, method);
      ASSERT_EQ(points.size(), 64u);
      for (const LinePoint& p : points) {
        EXPECT_NEAR(p.row_px, centre(p.column_px), 5e-4) << s;
        EXPECT_FALSE(p.saturated);
      }
      EXPECT_NEAR(points[0].width_px, std::sqrt(s * s + 1.0 / 12), 0.01 * s);
      EXPECT_NEAR(points[0].peak_dn, 200 * PixelMean(0, 0, s), 0.01 * 200);
    }
  }
}

TEST(DetectLaserLine, AConstantBackgroundDoesNotShiftTheCentre) {
  const auto centre = [](int column) { return 30 + column / 32.0; };
  Image<float> image(32, 64, 25);
  AddLine(200, 2, centre, &image);
  for (const double background : {0.0, 25.0, kNaN}) {
    LaserLineOptions options;
    options.background_dn = background;
    for (const LaserLineMethod method : kBoth) {
      const auto points = Detect(image, options, method);
      ASSERT_EQ(points.size(), 32u);
      for (const LinePoint& p : points) EXPECT_NEAR(p.row_px, centre(p.column_px), 1e-3);
    }
  }
}

// Cramer-Rao for a Gaussian of N photo-electrons without background: s / sqrt(N). The centre of
// gravity reaches it; unweighted least squares has 8 / 3^(3/2) = 1.5396 times
// its variance (residual variances and slopes integrated over the Gaussian).
TEST(DetectLaserLine, ShotNoiseSpreadAgainstCramerRao) {
  constexpr int kColumns = 3000;
  const double s = 2, peak = 300;
  const auto centre = [](int column) { return 20 + (column % 10) / 10.0; };
  Image<float> mean(kColumns, 40), image(kColumns, 40);
  AddLine(peak, s, centre, &mean);
  for (int row = 0; row < 40; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      CounterRandom random(5, row, column);
      image.At(row, column) = static_cast<float>(PoissonByInversion(mean.At(row, column), random));
    }
  }
  const double electrons = peak * s * std::sqrt(2 * std::numbers::pi);
  const double variance_px2 = s * s + 1.0 / 12;
  const double bound = std::sqrt(variance_px2 / electrons);
  const double standard_error = 1 / std::sqrt(2.0 * kColumns);  // of a deviation, relative
  const double expected[2] = {bound, bound * std::sqrt(1.5396)};
  for (const int m : {0, 1}) {
    const auto points = Detect(image, LaserLineOptions(), kBoth[m]);
    ASSERT_EQ(points.size(), static_cast<size_t>(kColumns));
    const Spread spread = ErrorsOf(points, centre);
    EXPECT_LT(std::abs(spread.mean), 4 * expected[m] / std::sqrt(kColumns)) << m;
    EXPECT_NEAR(spread.deviation / expected[m], 1, 4 * standard_error) << m;
  }
}

// A coherent line of standard deviation s imaged with a Gaussian amplitude spread exp(-x^2/(4
// r^2)): to first order the centre of gravity has the variance r s^2 / (2 sqrt(s^2 + r^2))
// (integral of the intensity's covariance |Gamma|^2). Dorsch, Haeusler, Herrmann (Applied Optics
// 33, 1994): at least lambda / (2 pi sin u), which is r for a Gaussian beam.
TEST(DetectLaserLine, SpeckleSpreadAgainstTheUncertaintyOfCoherentLight) {
  constexpr int kColumns = 2000, kRows = 160, kSamples = 3;
  const double s = 14, r = 0.7;
  const double centre = 79.5 + 0.3;
  std::vector<double> spread_function;
  const int reach = static_cast<int>(6 * r * kSamples);
  for (int k = -reach; k <= reach; ++k) {
    spread_function.push_back(std::exp(-std::pow(k / (2 * r * kSamples), 2)));
  }
  Image<float> image(kColumns, kRows);
  for (int column = 0; column < kColumns; ++column) {
    std::vector<std::complex<double>> field(kRows * kSamples);
    for (int i = 0; i < kRows * kSamples; ++i) {
      const double x = (i + 0.5) / kSamples - 0.5 - centre;
      const auto normal = CounterRandom(11, i, column).NormalPair();
      const double amplitude = std::exp(-x * x / (4 * s * s));
      field[i] = amplitude * std::complex<double>(normal[0], normal[1]);
    }
    for (int i = reach; i < kRows * kSamples - reach; ++i) {
      std::complex<double> sum = 0;
      for (int k = -reach; k <= reach; ++k) sum += spread_function[k + reach] * field[i + k];
      image.At(i / kSamples, column) += static_cast<float>(std::norm(sum));
    }
  }
  LaserLineOptions options;
  options.ridge_sigma_px = s;
  options.min_ridge_score_dn = 0.01;
  const auto points = Detect(image, options, LaserLineMethod::kStegerCentreOfGravity);
  ASSERT_GT(points.size(), 0.99 * kColumns);
  const Spread spread = ErrorsOf(points, [&](int) { return centre; });
  const double predicted = std::sqrt(r * s * s / (2 * std::sqrt(s * s + r * r)));
  EXPECT_LT(std::abs(spread.mean), 4 * predicted / std::sqrt(kColumns));
  // The first order leaves out terms of the relative variance of the sum, r / s = 5 %.
  EXPECT_NEAR(spread.deviation / predicted, 1, 4 / std::sqrt(2.0 * kColumns) + r / s);
  EXPECT_GT(spread.deviation, r);
}

TEST(DetectLaserLine, TiltedLines) {
  for (const double slope : {-0.3, 0.5, 1.0}) {
    const auto centre = [&](int column) { return 100 + slope * (column - 50.2); };
    const double along = 1.5 * std::sqrt(1 + slope * slope);
    Image<float> image(100, 200);
    AddLine(200, along, centre, &image);
    LaserLineOptions options;
    options.ridge_sigma_px = 1.5;
    for (const LaserLineMethod method : kBoth) {
      const auto points = Detect(image, options, method);
      ASSERT_EQ(points.size(), 100u) << slope;
      for (const LinePoint& p : points) EXPECT_NEAR(p.row_px, centre(p.column_px), 2e-3) << slope;
    }
  }
}

TEST(DetectLaserLine, SeveralLinesPerColumn) {
  const auto upper = [](int column) { return 20 + 0.05 * column; };
  const auto lower = [](int column) { return 34 + 0.05 * column; };
  Image<float> image(60, 70);
  AddLine(200, 1.5, upper, &image);
  AddLine(120, 1.5, lower, &image);
  LaserLineOptions options;
  options.ridge_sigma_px = 1.5;
  options.max_lines = 5;
  for (const LaserLineMethod method : kBoth) {
    const auto points = Detect(image, options, method);
    ASSERT_EQ(points.size(), 120u);
    for (int i = 0; i < 120; ++i) {
      EXPECT_EQ(points[i].column_px, i / 2);
      // The other line's flank: exp(-14^2/8/2.25) of its height at most.
      EXPECT_NEAR(points[i].row_px, (i % 2 ? lower : upper)(i / 2), 5e-3);
    }
  }
  options.max_lines = 1;
  for (const LaserLineMethod method : kBoth) {
    const auto points = Detect(image, options, method);
    ASSERT_EQ(points.size(), 60u);
    for (const LinePoint& p : points) EXPECT_NEAR(p.row_px, upper(p.column_px), 5e-3);
  }
}

TEST(DetectLaserLine, SaturatedPlateausAreOneLineWithoutBias) {
  const auto centre = [](int column) { return 60 + column / 40.0; };
  for (const double height : {300.0, 1000.0, 20000.0, 1e6}) {
    Image<float> image(40, 120);
    AddLine(height, 4, centre, &image);
    for (float& value : image.values) value = std::min(value, 255.F);
    LaserLineOptions options;
    options.saturation_dn = 255;
    options.max_lines = 3;
    options.half_window_px = 20;
    for (const LaserLineMethod method : kBoth) {
      const auto points = Detect(image, options, method);
      ASSERT_EQ(points.size(), 40u) << height;
      for (const LinePoint& p : points) {
        EXPECT_TRUE(p.saturated);
        // If the flank falls to 1/e within about a pixel (the two highest), sampling the clipped
        // profile leaves an error that changes sign within a pixel.
        EXPECT_NEAR(p.row_px, centre(p.column_px), height < 2000 ? 0.02 : 0.1) << height;
      }
      EXPECT_NEAR(ErrorsOf(points, centre).mean, 0, 1e-3) << height;
      if (method == LaserLineMethod::kGaussianFit) {
        // The flanks tell what the plateau hides.
        EXPECT_NEAR(points[0].peak_dn, height * PixelMean(0, 0, 4), 0.02 * height);
        EXPECT_NEAR(points[0].width_px, std::sqrt(16 + 1.0 / 12), 0.04);
      }
    }
  }
}

TEST(DetectLaserLine, AWidePlateauWithNoiseIsOneLine) {
  Image<float> image(200, 160);
  for (int row = 0; row < 160; ++row) {
    for (int column = 0; column < 200; ++column) {
      const double noise = 5 * CounterRandom(3, row, column).Normal();
      const double edge = 1 / (1 + std::exp((std::abs(row - 80.3) - 25) / 2));
      image.At(row, column) = static_cast<float>(std::clamp(20 + 600 * edge + noise, 0.0, 255.0));
    }
  }
  LaserLineOptions options;
  options.saturation_dn = 255;
  options.max_lines = 5;
  options.background_dn = kNaN;
  const auto points = Detect(image, options, LaserLineMethod::kStegerCentreOfGravity);
  ASSERT_EQ(points.size(), 200u);
  const Spread spread = ErrorsOf(points, [](int) { return 80.3; });
  EXPECT_LT(std::abs(spread.mean), 4 * spread.deviation / std::sqrt(200.0) + 0.01);
  EXPECT_LT(spread.deviation, 0.3);
}

// One line per column for every width of the plateau against the ridge scale, also where noise and
// the image's sides disturb it. The bound: information of the values that are not clipped.
TEST(DetectLaserLine, NoisyPlateausOfAnyWidthAreOneLine) {
  constexpr int kColumns = 1500, kRows = 70;
  const double s = 3, full = 1000;
  const auto centre = [](int column) { return 34 + (column % 10) / 10.0; };
  for (const double height : {1.2, 2.0, 4.0, 8.0, 64.0}) {
    Image<float> image(kColumns, kRows);
    AddLine(height * full, s, centre, &image);
    for (int row = 0; row < kRows; ++row) {
      for (int column = 0; column < kColumns; ++column) {
        float& value = image.At(row, column);
        const double noise = CounterRandom(8, row, column).Normal() * std::sqrt(value + 40);
        value = static_cast<float>(std::clamp(30 + value + noise, 0.0, full));
      }
    }
    double information = 0;
    for (int row = 0; row < kRows; ++row) {
      const double mean = height * full * PixelMean(row, 34.5, s);
      if (mean + 30 > full) continue;
      const double slope =
          height * full * (PixelMean(row, 34.501, s) - PixelMean(row, 34.499, s)) / 0.002;
      information += slope * slope / (mean + 40);
    }
    LaserLineOptions options;
    options.ridge_sigma_px = s;
    options.background_dn = 30;
    options.saturation_dn = full;
    options.max_lines = 3;
    for (const LaserLineMethod method : kBoth) {
      const auto points = Detect(image, options, method);
      ASSERT_EQ(points.size(), static_cast<size_t>(kColumns)) << height;
      const Spread spread = ErrorsOf(points, centre);
      EXPECT_LT(std::abs(spread.mean), 4 * spread.deviation / std::sqrt(kColumns)) << height;
      // Equal weights and plain centres lose some of it, but not most.
      EXPECT_LT(spread.deviation, 3 / std::sqrt(information)) << height;
    }
  }
}

TEST(DetectLaserLine, LinesAtTheImagesEdge) {
  for (const double row : {1.2, 2.7, 61.1}) {
    const auto centre = [&](int column) { return row + column / 100.0; };
    Image<float> image(50, 64);
    AddLine(200, 1.5, centre, &image);
    LaserLineOptions options;
    options.ridge_sigma_px = 1.5;
    // Cut by the edge, the window of the centre of gravity is short: pixels show.
    for (const auto& [method, tolerance] : {std::pair(kBoth[0], 0.05), std::pair(kBoth[1], 2e-3)}) {
      const auto points = Detect(image, options, method);
      EXPECT_EQ(points.size(), 50u) << row;
      for (const LinePoint& p : points) EXPECT_NEAR(p.row_px, centre(p.column_px), tolerance);
    }
  }
  // Its centre is outside.
  Image<float> outside(50, 64);
  AddLine(
      200, 1.5, [](int) { return -1.5; }, &outside);
  for (const LaserLineMethod method : kBoth) {
    EXPECT_TRUE(Detect(outside, LaserLineOptions(), method).empty());
  }
}

TEST(DetectLaserLine, NoLineNoPoint) {
  Image<float> noise(100, 100), plain(100, 100, 37);
  for (int i = 0; i < 10000; ++i) {
    noise.values[i] = static_cast<float>(20 + 4 * CounterRandom(9, i).Normal());
  }
  LaserLineOptions options;
  options.max_lines = 10;
  options.saturation_dn = 255;
  for (const LaserLineMethod method : kBoth) {
    EXPECT_TRUE(Detect(noise, options, method).empty());
    EXPECT_TRUE(Detect(plain, options, method).empty());
    EXPECT_TRUE(Detect(Image<float>(100, 100, 255), options, method).empty());
    EXPECT_TRUE(Detect(Image<float>(1, 1, 5), options, method).empty());
    EXPECT_TRUE(Detect(Image<float>(30, 1, 5), options, method).empty());
    EXPECT_TRUE(Detect(Image<float>(3, 3, std::nanf("")), options, method).empty());
  }
  options.min_ridge_score_dn = 0;  // every maximum counts: nothing may break
  for (const LaserLineMethod method : kBoth) {
    for (const LinePoint& p : Detect(noise, options, method)) {
      EXPECT_TRUE(p.row_px >= -0.5 && p.row_px <= 99.5);
      EXPECT_TRUE(std::isfinite(p.peak_dn) && std::isfinite(p.width_px));
    }
  }
}

TEST(DetectLaserLine, LostPixelsAreBridged) {
  const auto centre = [](int) { return 30.4; };
  Image<float> image(60, 64);
  AddLine(200, 2, centre, &image);
  image.At(30, 5) = std::numeric_limits<float>::quiet_NaN();
  image.At(31, 20) = std::numeric_limits<float>::infinity();
  for (int row = 0; row < 64; ++row) image.At(row, 40) = std::numeric_limits<float>::quiet_NaN();
  for (const LaserLineMethod method : kBoth) {
    const auto points = Detect(image, LaserLineOptions(), method);
    EXPECT_GE(points.size(), 59u);
    for (const LinePoint& p : points) {
      if (p.column_px == 40) continue;
      EXPECT_NEAR(p.row_px, 30.4, p.column_px == 5 || p.column_px == 20 ? 0.1 : 1e-3);
    }
  }
}

TEST(DetectLaserLine, RefusesBadOptions) {
  const Image<float> image(10, 10, 1);
  const auto code = [&](const std::function<void(LaserLineOptions*)>& change) {
    LaserLineOptions options;
    change(&options);
    return DetectLaserLine(image, options, kBoth[0]).status().code();
  };
  const auto bad = absl::StatusCode::kInvalidArgument;
  EXPECT_EQ(code([](auto* o) { o->ridge_sigma_px = 0.5; }), bad);
  EXPECT_EQ(code([](auto* o) { o->ridge_sigma_px = kNaN; }), bad);
  EXPECT_EQ(code([](auto* o) { o->ridge_sigma_px = 21; }), bad);
  EXPECT_EQ(code([](auto* o) { o->min_ridge_score_dn = -1; }), bad);
  EXPECT_EQ(code([](auto* o) { o->half_window_px = -1; }), bad);
  EXPECT_EQ(code([](auto* o) { o->max_lines = 0; }), bad);
  EXPECT_EQ(code([](auto* o) { o->saturation_dn = kNaN; }), bad);
  EXPECT_EQ(code([](auto*) {}), absl::StatusCode::kOk);
  EXPECT_EQ(DetectLaserLine(Image<float>(), LaserLineOptions(), kBoth[0]).status().code(), bad);
}

}  // namespace
}  // namespace sightline
