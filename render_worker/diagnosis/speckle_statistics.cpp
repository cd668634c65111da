#include "render_worker/diagnosis/speckle_statistics.h"

#include <Eigen/Core>
#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <cstdlib>
#include <numbers>

namespace sightline {

namespace {

constexpr int kLeastSamples = 18, kMostSamples = 40;  // of the pupil, over its diameter

}  // namespace

SpecklePixelCovariance::SpecklePixelCovariance(const Pupil& pupil, const PupilWeight& weight,
                                               double wavelength_m, double image_distance_m,
                                               double pixel_pitch_m, int max_lag)
    : max_lag_(max_lag) {
  // The mean over two pixels a lag apart is, by Parseval, an integral over the frequencies of the
  // irradiance: autocorrelation of the pupil's transmission times squared sinc of the pixel.
  // Samples of the pupil make the correlation periodic: enough of them that it has died out at half
  // the period, at a bearable cost; beyond that it counts as zero.
  const double radius_m = pupil.OuterRadius();
  const double period_of_one_m = wavelength_m * image_distance_m / (2 * radius_m);
  const auto samples_for = [&](int lag) {
    return std::clamp(
        static_cast<int>(std::ceil(2.2 * (lag + 1) * pixel_pitch_m / period_of_one_m)),
        kLeastSamples, kMostSamples);
  };
  const int rows = samples_for(max_lag), columns = std::max(kLeastSamples, rows / 2);
  const auto reach = [&](int samples) {
    return std::min(max_lag, static_cast<int>(0.5 * samples * period_of_one_m / pixel_pitch_m));
  };
  row_reach_ = std::max(1, reach(rows));
  column_reach_ = std::max(1, reach(columns));
  const double row_step_m = 2 * radius_m / rows, column_step_m = 2 * radius_m / columns;
  std::vector<double> transmission(static_cast<size_t>(rows) * columns);
  double total = 0;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double x = (j + 0.5) * column_step_m - radius_m, y = (i + 0.5) * row_step_m - radius_m;
      const double passed = pupil.Transmission(x, y);
      const double value = passed == 0 ? 0 : passed * passed * weight(x, y);
      transmission[i * columns + j] = value;
      total += value;
    }
  }
  const int side = max_lag + 1;
  values_.assign(static_cast<size_t>(side) * side, 0);
  const auto pixel = [&](double q) {
    const double x = std::numbers::pi * q * pixel_pitch_m;
    return x == 0 ? 1 : std::sin(x) / x;
  };
  // Cosines of all lags and squared transfer of the pixel, by frequency; separable.
  const auto waves = [&](int samples, double step_m) {
    const double q_step_per_m = step_m / (wavelength_m * image_distance_m);
    Eigen::MatrixXd factors(side, 2 * samples - 1);
    for (int d = 0; d < 2 * samples - 1; ++d) {
      const double q = (d - samples + 1) * q_step_per_m;
      for (int lag = 0; lag < side; ++lag) {
        factors(lag, d) =
            pixel(q) * pixel(q) * std::cos(2 * std::numbers::pi * pixel_pitch_m * q * lag);
      }
    }
    return factors;
  };
  const Eigen::MatrixXd row_waves = waves(rows, row_step_m);
  const Eigen::MatrixXd column_waves = waves(columns, column_step_m);
  // The overlap at (-di, -dj) is that at (di, dj).
  Eigen::VectorXd along_row(side);
  for (int di = 0; di < rows; ++di) {
    along_row.setZero();
    for (int dj = -columns + 1; dj < columns; ++dj) {
      double overlap = 0;
      for (int i = 0; i < rows - di; ++i) {
        const double* a = &transmission[i * columns];
        const double* b = &transmission[(i + di) * columns];
        for (int j = std::max(0, -dj); j < std::min(columns, columns - dj); ++j) {
          overlap += a[j] * b[j + dj];
        }
      }
      along_row += overlap * column_waves.col(dj + columns - 1);
    }
    const double both = (di == 0 ? 1 : 2) / (total * total);
    for (int r = 0; r < side; ++r) {
      const double factor = both * row_waves(r, di + rows - 1);
      for (int c = 0; c < side; ++c) values_[r * side + c] += factor * along_row[c];
    }
  }
}

LineSpeckle::LineSpeckle(const Pupil& pupil, double wavelength_m, double image_distance_m,
                         double blur_per_pupil, double pixel_pitch_m,
                         const std::vector<double>& ideal, double first_v_m,
                         double sample_pitch_m) {
  double sum = 0, moment = 0;
  for (size_t i = 0; i < ideal.size(); ++i) {
    sum += ideal[i];
    moment += ideal[i] * (first_v_m + static_cast<double>(i) * sample_pitch_m);
  }
  centre_m_ = sum > 0 ? moment / sum : 0;
  double square = 0;
  for (size_t i = 0; i < ideal.size(); ++i) {
    const double v = first_v_m + static_cast<double>(i) * sample_pitch_m - centre_m_;
    square += ideal[i] * v * v;
  }
  const double line_m = sum > 0 ? std::sqrt(square / sum) : 1;
  // Diffraction as a Gaussian of the Airy pattern's width: a line finer than that is coherent
  // across (sigma_line / hypot stretches the speckle), and blurs what lights the pupil.
  const double spread_m = 0.42 * wavelength_m * image_distance_m / (2 * pupil.OuterRadius());
  const double stretch = line_m / std::hypot(line_m, spread_m);
  const double lit_m = std::hypot(line_m, spread_m);
  const double blur = std::abs(blur_per_pupil);
  const double blur_radius_m = blur * pupil.OuterRadius();
  const double size_px =
      wavelength_m * image_distance_m / (2 * pupil.OuterRadius()) /
      (pixel_pitch_m * std::min(stretch, blur_radius_m > lit_m ? lit_m / blur_radius_m : 1.0));
  const int lag = std::clamp(2 + static_cast<int>(std::ceil(3 * size_px)), 3, 10);
  // In focus every place is alike.
  const int sides = blur_radius_m < 0.1 * lit_m ? 0 : 4;
  spacing_m_ = sides == 0 ? 1 : (blur_radius_m + 2 * lit_m) / sides;
  for (int i = -sides; i <= sides; ++i) {
    const double offset_m = i * spacing_m_;
    places_.emplace_back(
        pupil,
        [&](double x, double y) {
          if (pupil.Transmission(x, y / stretch) == 0) return 0.0;
          const double v = (offset_m - blur * y) / lit_m;
          return sides == 0 ? 1.0 : std::exp(-0.5 * v * v) + 1e-12;
        },
        wavelength_m, image_distance_m, pixel_pitch_m, lag);
  }
}

int LineSpeckle::PlaceOf(double v_m) const {
  const int sides = (places() - 1) / 2;
  const double place = std::clamp((v_m - centre_m_) / spacing_m_, -1.0 * sides, 1.0 * sides);
  return sides + static_cast<int>(std::lround(place));
}

double SpecklePixelCovariance::At(int rows, int columns) const {
  rows = std::abs(rows);
  columns = std::abs(columns);
  if (rows > row_reach_ || columns > column_reach_) return 0;
  return values_[static_cast<size_t>(rows) * (max_lag_ + 1) + columns];
}

std::vector<double> GammaLevels(double contrast_squared, int count) {
  std::vector<double> levels(count, 1.0);
  if (contrast_squared <= 0) return levels;
  const double shape = 1 / contrast_squared;
  double below = 0;  // integral of x dF up to the interval's start
  for (int i = 0; i < count; ++i) {
    const double end =
        i + 1 == count
            ? 1
            : boost::math::gamma_p(shape + 1, boost::math::gamma_p_inv(shape, (i + 1.0) / count));
    levels[i] = (end - below) * count;
    below = end;
  }
  return levels;
}

}  // namespace sightline
