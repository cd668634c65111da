// SPDX-License-Identifier: Apache-2.0
#include "render_worker/speckle/speckle_statistics.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <numeric>
#include <tuple>
#include <utility>

#include "core/memo/memo.h"

namespace sightline {

namespace {

constexpr int kLeastSamples = 18, kMostSamples = 40;  // of the pupil, over its diameter

// The pupil sampled for one pixel pitch and greatest lag. The mean over two pixels a lag apart is,
// by Parseval, an integral over the frequencies of the irradiance: autocorrelation of the pupil's
// transmission times squared sinc of the pixel. Samples of the pupil make the correlation periodic:
// enough of them that it has died out at half the period, at a bearable cost; beyond that it counts
// as zero.
struct SampledPupil {
  int max_lag = 0;
  int rows = 0, columns = 0;            // samples
  int row_reach = 1, column_reach = 1;  // lags beyond count as zero
  double radius_m = 0, row_step_m = 0, column_step_m = 0;
  // By lag and frequency: cosine times the squared transfer of the pixel.
  Eigen::MatrixXd row_waves, column_waves;

  double X(int column) const { return (column + 0.5) * column_step_m - radius_m; }
  double Y(int row) const { return (row + 0.5) * row_step_m - radius_m; }
};

Eigen::MatrixXd Waves(int samples, double q_step_per_m, double pixel_pitch_m, int max_lag) {
  Eigen::MatrixXd factors(max_lag + 1, 2 * samples - 1);
  for (int d = 0; d < samples; ++d) {
    const double x = std::numbers::pi * q_step_per_m * d * pixel_pitch_m;
    const double pixel = d == 0 ? 1 : std::sin(x) / x;
    for (int lag = 0; lag <= max_lag; ++lag) {
      factors(lag, samples - 1 + d) = factors(lag, samples - 1 - d) =
          pixel * pixel * std::cos(2 * x * lag);
    }
  }
  return factors;
}

SampledPupil SamplePupil(double radius_m, double wavelength_m, double image_distance_m,
                         double pixel_pitch_m, int max_lag) {
  SampledPupil sampled;
  const double period_of_one_m = wavelength_m * image_distance_m / (2 * radius_m);
  const auto samples_for = [&](int lag) {
    return std::clamp(
        static_cast<int>(std::ceil(2.2 * (lag + 1) * pixel_pitch_m / period_of_one_m)),
        kLeastSamples, kMostSamples);
  };
  const auto reach = [&](int samples) {
    return std::max(
        1, std::min(max_lag, static_cast<int>(0.5 * samples * period_of_one_m / pixel_pitch_m)));
  };
  sampled.max_lag = max_lag;
  sampled.rows = samples_for(max_lag);
  sampled.columns = std::max(kLeastSamples, sampled.rows / 2);
  sampled.row_reach = reach(sampled.rows);
  sampled.column_reach = reach(sampled.columns);
  sampled.radius_m = radius_m;
  sampled.row_step_m = 2 * radius_m / sampled.rows;
  sampled.column_step_m = 2 * radius_m / sampled.columns;
  const double q_per_m = 1 / (wavelength_m * image_distance_m);
  sampled.row_waves = Waves(sampled.rows, sampled.row_step_m * q_per_m, pixel_pitch_m, max_lag);
  sampled.column_waves =
      Waves(sampled.columns, sampled.column_step_m * q_per_m, pixel_pitch_m, max_lag);
  return sampled;
}

// Joint contribution of two rows of the pupil, by lag along the line: overlaps of their samples at
// all shifts times the waves.
class RowOverlaps {
 public:
  // `light`: what passes each sample, row by row.
  RowOverlaps(const SampledPupil& sampled, const std::vector<double>& light)
      : kind_of_row_(sampled.rows) {
    const int columns = sampled.columns;
    // Rows of a circle are alike in pairs, and many near its middle.
    std::vector<const double*> kinds;
    for (int i = 0; i < sampled.rows; ++i) {
      const double* row = &light[static_cast<size_t>(i) * columns];
      const auto found = std::find_if(kinds.begin(), kinds.end(), [&](const double* kind) {
        return std::equal(row, row + columns, kind);
      });
      kind_of_row_[i] = static_cast<int>(found - kinds.begin());
      if (found == kinds.end()) kinds.push_back(row);
    }
    const int count = static_cast<int>(kinds.size());
    by_kinds_.resize(static_cast<size_t>(count) * count);
    totals_.resize(count);
    std::vector<double> twice(3 * static_cast<size_t>(columns), 0);  // with room for the shifts
    Eigen::VectorXd overlaps(2 * columns - 1);
    for (int k = 0; k < count; ++k) {
      std::copy(kinds[k], kinds[k] + columns, twice.begin() + columns);
      totals_[k] = std::accumulate(kinds[k], kinds[k] + columns, 0.0);
      for (int l = 0; l <= k; ++l) {
        for (int d = -columns + 1; d < columns; ++d) {
          overlaps[d + columns - 1] =
              std::inner_product(kinds[l], kinds[l] + columns, twice.begin() + columns + d, 0.0);
        }
        // The waves are even: the order of the two does not matter.
        by_kinds_[k * count + l] = by_kinds_[l * count + k] = sampled.column_waves * overlaps;
      }
    }
  }

  const Eigen::VectorXd& Of(int row, int other) const {
    return by_kinds_[kind_of_row_[row] * totals_.size() + kind_of_row_[other]];
  }
  double Total(int row) const { return totals_[kind_of_row_[row]]; }

 private:
  std::vector<int> kind_of_row_;
  std::vector<Eigen::VectorXd> by_kinds_;
  std::vector<double> totals_;
};

// Covariance by lag (rows, columns), rows weighted.
std::vector<double> PixelCovariances(const SampledPupil& sampled, const RowOverlaps& overlaps,
                                     const std::vector<double>& row_weights) {
  const int side = sampled.max_lag + 1;
  double total = 0;
  for (int i = 0; i < sampled.rows; ++i) total += row_weights[i] * overlaps.Total(i);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> values =
      Eigen::MatrixXd::Zero(side, side);
  Eigen::VectorXd along_row(side);
  for (int d = 0; d < sampled.rows; ++d) {
    along_row.setZero();
    for (int i = 0; i + d < sampled.rows; ++i) {
      const double both = row_weights[i] * row_weights[i + d];
      if (both != 0) along_row += both * overlaps.Of(i, i + d);
    }
    // The overlap at -d is that at d.
    const double factor = (d == 0 ? 1 : 2) / (total * total);
    values.noalias() +=
        (factor * sampled.row_waves.col(d + sampled.rows - 1)) * along_row.transpose();
  }
  return {values.data(), values.data() + values.size()};
}

// A line of Gaussian profile through a plain circular lens. The mutual intensity of two points of
// the image at v0 +- d/2 across the line and a distance du along it is that of the pupil's chords,
//   J = sum over x of cos(k x du) sum over y of W(x, y) exp(i k d y),  k = 2 pi / (lambda b),
//   W = integral of the line's spectrum times cos(k eta (v0 - blur y)) over |eta| < 2 (Y(x) - |y|),
// eta the distance of two points of the chord of half length Y(x), y their middle (van Cittert and
// Zernike, sorted by eta and y). No approximation for the line's width or for defocus.
class CircleLine {
 public:
  CircleLine(double radius_m, double wavelength_m, double image_distance_m, double blur,
             double line_m, double lit_m, double pitch_m, int row_reach, int max_lag)
      : wave_per_m2_(2 * std::numbers::pi / (wavelength_m * image_distance_m)),
        blur_(blur),
        line_m_(line_m),
        radius_m_(radius_m),
        lit_m_(lit_m),
        pitch_m_(pitch_m),
        max_lag_(max_lag),
        row_reach_(std::min(row_reach, max_lag)) {
    const double airy_px = wavelength_m * image_distance_m / (2 * radius_m) / pitch_m;
    // As far as the chords tell lags along the line apart; across it heights can be had at will.
    column_reach_ = std::clamp(static_cast<int>(0.6 * kChords * airy_px), 1, max_lag);
    steps_per_px_ = 2 * std::clamp(static_cast<int>(std::ceil(2.2 / airy_px)), 2, 8);
    heights_ = std::clamp(static_cast<int>(std::ceil(std::max(2.2 * (row_reach_ + 1) / airy_px,
                                                              3 * blur * radius_m / lit_m))),
                          32, 120);
    height_step_m_ = 2 * radius_m / heights_;
    // Chords at the nodes of Gauss and Chebyshev: exact for the rim's square root. The other half
    // is alike.
    for (int j = 0; j < kChords; ++j) {
      const double angle = (j + 0.5) * std::numbers::pi / (2 * kChords);
      chord_half_m_[j] = radius_m * std::sin(angle);
      chord_x_m_[j] = radius_m * std::cos(angle);
      chord_weight_[j] = std::sin(angle);
    }
    eta_step_m_ = std::min(2 * radius_m, 5.5 / (wave_per_m2_ * line_m)) / kEtas;
    for (int e = 0; e <= kEtas; ++e) {
      const double eta = e * eta_step_m_;
      const double s = wave_per_m2_ * line_m * eta;
      spectrum_[e] = std::exp(-0.5 * s * s);
      double transfer = 0;
      for (int j = 0; j < kChords; ++j) {
        const double half = chord_half_m_[j] - 0.5 * eta;
        if (half <= 0) continue;
        const double phase = wave_per_m2_ * eta * blur * half;
        transfer += chord_weight_[j] * 2 * half * (phase == 0 ? 1 : std::sin(phase) / phase);
      }
      transfer_[e] = transfer;
    }
    const double phase_step = wave_per_m2_ * pitch_m / steps_per_px_;
    along_ = Eigen::MatrixXd(kChords, Distances(column_reach_));
    for (int d = 0; d < along_.cols(); ++d) {
      const double phase = d * phase_step;
      for (int j = 0; j < kChords; ++j) {
        along_(j, d) = chord_weight_[j] * std::cos(phase * chord_x_m_[j]);
      }
    }
    across_cos_ = Eigen::MatrixXd(heights_, Distances(row_reach_));
    across_sin_ = Eigen::MatrixXd(heights_, Distances(row_reach_));
    for (int d = 0; d < across_cos_.cols(); ++d) {
      const double phase = d * phase_step;
      for (int i = 0; i < heights_; ++i) {
        across_cos_(i, d) = std::cos(phase * Height(i));
        across_sin_(i, d) = std::sin(phase * Height(i));
      }
    }
    row_pixels_ = PixelsApart(row_reach_);
    column_pixels_ = PixelsApart(column_reach_);
  }

  int row_reach() const { return row_reach_; }
  int column_reach() const { return column_reach_; }

  // Covariance over the product of means, by lag, about v0.
  std::vector<double> PixelCovariances(double v0_m) const {
    Eigen::MatrixXd lit = Eigen::MatrixXd::Zero(kChords, heights_);
    std::array<double, kEtas + 1> sum{};
    for (int i = 0; i < heights_; ++i) {
      const double v = v0_m - blur_ * Height(i);
      if (std::abs(v) > 8 * lit_m_) continue;
      double before = spectrum_[0];
      // Cosines by recurrence.
      const double turn = 2 * std::cos(wave_per_m2_ * v * eta_step_m_);
      double cosine = turn / 2, last = 1;
      for (int e = 1; e <= kEtas; ++e) {
        const double here = spectrum_[e] * cosine;
        sum[e] = sum[e - 1] + (before + here) * eta_step_m_;
        before = here;
        const double next = turn * cosine - last;
        last = cosine;
        cosine = next;
      }
      for (int j = 0; j < kChords; ++j) {
        // The chord's end cuts a sample: mean over parts of it.
        for (const double part : {-0.375, -0.125, 0.125, 0.375}) {
          const double widest =
              2 * (chord_half_m_[j] - std::abs(Height(i) + part * height_step_m_));
          if (widest <= 0) continue;
          const double place = widest / eta_step_m_;
          const int below = static_cast<int>(place);
          lit(j, i) += 0.25 * (below >= kEtas
                                   ? sum[kEtas]
                                   : sum[below] + (place - below) * (sum[below + 1] - sum[below]));
        }
      }
    }
    const Eigen::MatrixXd real = (lit * across_cos_).transpose() * along_;
    const Eigen::MatrixXd imaginary = (lit * across_sin_).transpose() * along_;
    const Eigen::MatrixXd squares =
        (real.array().square() + imaginary.array().square()) * height_step_m_ * height_step_m_;
    const double floor = 1e-6 * Irradiance(0);
    Eigen::VectorXd means(squares.rows());
    for (int d = 0; d < means.size(); ++d) {
      const double half_m = 0.5 * d * pitch_m_ / steps_per_px_;
      means[d] =
          std::max(floor, Irradiance(v0_m + half_m)) * std::max(floor, Irradiance(v0_m - half_m));
    }
    // Over the product of the two pixels' light: of the whole pixels, which a line of their size
    // lights unevenly.
    const Eigen::VectorXd pixel_means = row_pixels_ * means;
    const Eigen::MatrixXd near = pixel_means.cwiseInverse().asDiagonal() *
                                 (row_pixels_ * squares * column_pixels_.transpose());
    const int side = max_lag_ + 1;
    std::vector<double> values(static_cast<size_t>(side) * side, 0);
    for (int r = 0; r <= row_reach_; ++r) {
      for (int c = 0; c <= column_reach_; ++c) values[r * side + c] = near(r, c);
    }
    return values;
  }

 private:
  static constexpr int kChords = 12, kEtas = 64;

  double Height(int i) const { return (i + 0.5) * height_step_m_ - radius_m_; }
  int Distances(int reach) const { return (reach + 1) * steps_per_px_ + 1; }

  // Two pixels, by lag: their distances are spread as a triangle; Simpson's rule on either side.
  Eigen::MatrixXd PixelsApart(int reach) const {
    Eigen::MatrixXd pixels = Eigen::MatrixXd::Zero(reach + 1, Distances(reach));
    for (int lag = 0; lag <= reach; ++lag) {
      for (int t = -steps_per_px_; t <= steps_per_px_; ++t) {
        const double simpson = t == 0 ? 2 : t % 2 == 0 ? 2 : 4;
        pixels(lag, std::abs(lag * steps_per_px_ + t)) +=
            simpson / (3 * steps_per_px_) * (1 - std::abs(t) / static_cast<double>(steps_per_px_));
      }
    }
    return pixels;
  }

  double Irradiance(double v_m) const {
    double sum = 0.5 * spectrum_[0] * transfer_[0];
    const double turn = 2 * std::cos(wave_per_m2_ * v_m * eta_step_m_);
    double cosine = turn / 2, last = 1;
    for (int e = 1; e <= kEtas; ++e) {
      sum += (e == kEtas ? 0.5 : 1) * spectrum_[e] * transfer_[e] * cosine;
      const double next = turn * cosine - last;
      last = cosine;
      cosine = next;
    }
    return 2 * sum * eta_step_m_;
  }

  double wave_per_m2_, blur_, line_m_, radius_m_, lit_m_, pitch_m_;
  int max_lag_, row_reach_, column_reach_ = 1, steps_per_px_ = 4, heights_ = 32;
  double height_step_m_ = 0, eta_step_m_ = 0;
  std::array<double, kChords> chord_half_m_{}, chord_x_m_{}, chord_weight_{};
  std::array<double, kEtas + 1> spectrum_{}, transfer_{};
  Eigen::MatrixXd along_, across_cos_, across_sin_, row_pixels_, column_pixels_;
};

// To some 1e-11: lines that differ by rounding only count as one.
double Rounded(double value) {
  int exponent = 0;
  const double mantissa = std::frexp(value, &exponent);
  return std::ldexp(std::round(std::ldexp(mantissa, 36)), exponent - 36);
}

// Share of the light that passes the cell of a sample; a sample alone makes a shape's area wrong by
// some per cent. `stretch`: of the pupil along y, where nothing passes beyond its rim.
double LightThrough(const Pupil& pupil, const SampledPupil& sampled, int row, int column,
                    double stretch) {
  constexpr int kParts = 4;
  double sum = 0;
  for (int i = 0; i < kParts; ++i) {
    const double y = sampled.Y(row) + ((i + 0.5) / kParts - 0.5) * sampled.row_step_m;
    for (int j = 0; j < kParts; ++j) {
      const double x = sampled.X(column) + ((j + 0.5) / kParts - 0.5) * sampled.column_step_m;
      const double passed =
          stretch != 1 && pupil.Transmission(x, y / stretch) == 0 ? 0 : pupil.Transmission(x, y);
      sum += passed * passed;
    }
  }
  return sum / (kParts * kParts);
}

// A line of Gaussian profile with the optics that image it.
struct SpeckledLine {
  double wavelength_m, image_distance_m, blur, pixel_pitch_m;
  double line_m, lit_m;  // standard deviations without and with diffraction
  int row_reach;         // lag across the line beyond which speckle is independent
  int lag;               // greatest
};

constexpr int kSides = 4;  // places on either side of the line's middle

std::vector<SpecklePixelCovariance> OfCircle(double radius_m, const SpeckledLine& line,
                                             double spacing_m) {
  const CircleLine circle(radius_m, line.wavelength_m, line.image_distance_m, line.blur,
                          line.line_m, line.lit_m, line.pixel_pitch_m, line.row_reach, line.lag);
  std::vector<SpecklePixelCovariance> places;
  for (int place = -kSides; place <= 0; ++place) {
    places.emplace_back(line.lag, circle.row_reach(), circle.column_reach(),
                        circle.PixelCovariances(-place * spacing_m));
  }
  for (int place = 1; place <= kSides; ++place) {
    SpecklePixelCovariance other_side = places[kSides - place];
    places.push_back(std::move(other_side));
  }
  return places;
}

// By samples of the pupil; the line's own width counts only as far as it lights them.
std::vector<SpecklePixelCovariance> OfSamples(const Pupil& pupil, const SpeckledLine& line,
                                              double spacing_m) {
  const SampledPupil sampled = SamplePupil(pupil.OuterRadius(), line.wavelength_m,
                                           line.image_distance_m, line.pixel_pitch_m, line.lag);
  std::vector<double> light;
  for (int i = 0; i < sampled.rows; ++i) {
    for (int j = 0; j < sampled.columns; ++j) {
      light.push_back(LightThrough(pupil, sampled, i, j, line.line_m / line.lit_m));
    }
  }
  const RowOverlaps overlaps(sampled, light);
  std::vector<SpecklePixelCovariance> places;
  std::vector<double> weights(sampled.rows, 1.0);
  for (int place = -kSides; place <= kSides; ++place) {
    for (int i = 0; i < sampled.rows; ++i) {
      const double v = (place * spacing_m - line.blur * sampled.Y(i)) / line.lit_m;
      weights[i] = std::exp(-0.5 * v * v) + 1e-12;
    }
    places.emplace_back(line.lag, sampled.row_reach, sampled.column_reach,
                        PixelCovariances(sampled, overlaps, weights));
  }
  return places;
}

// Change by the pupil's shape, relative to the statistics of the circle around it.
std::vector<SpecklePixelCovariance> OfShape(const Pupil& pupil, const SpeckledLine& line,
                                            double spacing_m) {
  Pupil circle;
  circle.radius_m = pupil.OuterRadius();
  const std::vector<SpecklePixelCovariance> exact = OfCircle(circle.radius_m, line, spacing_m);
  const std::vector<SpecklePixelCovariance> shaped = OfSamples(pupil, line, spacing_m);
  const std::vector<SpecklePixelCovariance> round = OfSamples(circle, line, spacing_m);
  std::vector<SpecklePixelCovariance> places;
  for (size_t place = 0; place < exact.size(); ++place) {
    std::vector<double> values;
    for (int r = 0; r <= line.lag; ++r) {
      for (int c = 0; c <= line.lag; ++c) {
        const double before = round[place].At(r, c);
        const double change = before > 1e-3 ? std::max(0.0, shaped[place].At(r, c) / before) : 1.0;
        values.push_back(exact[place].At(r, c) * change);
      }
    }
    places.emplace_back(line.lag, line.lag, line.lag, std::move(values));
  }
  return places;
}

}  // namespace

SpecklePixelCovariance::SpecklePixelCovariance(const Pupil& pupil, const PupilWeight& weight,
                                               double wavelength_m, double image_distance_m,
                                               double pixel_pitch_m, int max_lag)
    : max_lag_(max_lag) {
  const SampledPupil sampled =
      SamplePupil(pupil.OuterRadius(), wavelength_m, image_distance_m, pixel_pitch_m, max_lag);
  row_reach_ = sampled.row_reach;
  column_reach_ = sampled.column_reach;
  std::vector<double> light;
  for (int i = 0; i < sampled.rows; ++i) {
    for (int j = 0; j < sampled.columns; ++j) {
      light.push_back(LightThrough(pupil, sampled, i, j, 1) * weight(sampled.X(j), sampled.Y(i)));
    }
  }
  values_ = PixelCovariances(sampled, RowOverlaps(sampled, light),
                             std::vector<double>(sampled.rows, 1.0));
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
  const double line_m = Rounded(sum > 0 ? std::sqrt(square / sum) : 1);
  // Diffraction as a Gaussian of the Airy pattern's width: a line finer than that is coherent
  // across (sigma_line / hypot stretches the speckle), and blurs what lights the pupil.
  const double spread_m = 0.42 * wavelength_m * image_distance_m / (2 * pupil.OuterRadius());
  const double stretch = line_m / std::hypot(line_m, spread_m);
  const double lit_m = std::hypot(line_m, spread_m);
  const double blur = Rounded(std::abs(blur_per_pupil));
  const double blur_radius_m = blur * pupil.OuterRadius();
  const double size_px =
      wavelength_m * image_distance_m / (2 * pupil.OuterRadius()) /
      (pixel_pitch_m * std::min(stretch, blur_radius_m > lit_m ? lit_m / blur_radius_m : 1.0));
  const int lag = std::clamp(2 + static_cast<int>(std::ceil(3 * size_px)), 3, 10);
  const int row_reach = 1 + static_cast<int>(std::ceil(1.5 * size_px));
  spacing_m_ = (blur_radius_m + 2 * lit_m) / kSides;
  // The same line through the same lens recurs often, since most effects leave both
  // unchanged.
  using Key = std::tuple<Pupil, double, double, double, double, double>;
  constexpr size_t kMost = 4096;  // up to 9 kB each
  static auto* const known =
      new Memo<Key, std::shared_ptr<const std::vector<SpecklePixelCovariance>>>(kMost);
  const SpeckledLine line{wavelength_m, image_distance_m, blur, pixel_pitch_m, line_m,
                          lit_m,        row_reach,        lag};
  // Speckle of an even object does not depend on the wavefront's errors.
  Pupil shape = pupil;
  shape.zernike_m.clear();
  shape.seidel.clear();
  if (shape.IsFullCircle()) shape.clips.clear();
  places_ = known->Get({shape, wavelength_m, image_distance_m, blur, pixel_pitch_m, line_m}, [&] {
    return std::make_shared<const std::vector<SpecklePixelCovariance>>(
        shape.IsFullCircle() ? OfCircle(shape.radius_m, line, spacing_m_)
                             : OfShape(shape, line, spacing_m_));
  });
}

LineSpeckle LineSpeckle::With(std::vector<SpecklePixelCovariance> covariances) const {
  LineSpeckle other = *this;
  other.places_ =
      std::make_shared<const std::vector<SpecklePixelCovariance>>(std::move(covariances));
  return other;
}

int LineSpeckle::PlaceOf(double v_m) const {
  const int sides = (places() - 1) / 2;
  const double place = std::clamp((v_m - centre_m_) / spacing_m_, -1.0 * sides, 1.0 * sides);
  return sides + static_cast<int>(std::lround(place));
}

SpecklePixelCovariance SpecklePixelCovariance::Shared(const Image<double>& shares) const {
  constexpr double kNoShare = 1e-7;  // of the pixel's light, squared
  const int rows = shares.rows_px, columns = shares.columns_px;
  // By distance: products of shares.
  Image<double> products(2 * columns - 1, 2 * rows - 1, 0.0);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      for (int k = 0; shares.At(i, j) != 0 && k < rows; ++k) {
        for (int l = 0; l < columns; ++l) {
          products.At(k - i + rows - 1, l - j + columns - 1) += shares.At(i, j) * shares.At(k, l);
        }
      }
    }
  }
  std::vector<double> values(static_cast<size_t>(max_lag_ + 1) * (max_lag_ + 1), 0.0);
  for (int i = 0; i < products.rows_px; ++i) {
    for (int j = 0; j < products.columns_px; ++j) {
      const double product = products.At(i, j);
      if (std::abs(product) < kNoShare) continue;
      size_t at = 0;
      for (int r = 0; r <= max_lag_; ++r) {
        for (int c = 0; c <= max_lag_; ++c) {
          values[at++] += product * At(r + i - rows + 1, c + j - columns + 1);
        }
      }
    }
  }
  return {max_lag_, max_lag_, max_lag_, std::move(values)};
}

double SpecklePixelCovariance::At(int rows, int columns) const {
  rows = std::abs(rows);
  columns = std::abs(columns);
  if (rows > row_reach_ || columns > column_reach_) return 0;
  return values_[static_cast<size_t>(rows) * (max_lag_ + 1) + columns];
}

double CovarianceOfMeans(const SpecklePixelCovariance& pixel, int distance, int columns, int step,
                         int phase) {
  double sum = 0;
  for (int c = -columns + 1; c < columns; ++c) {
    sum += (1 - std::abs(c) / static_cast<double>(columns)) * pixel.At(distance, c * step + phase);
  }
  return sum / columns;
}

double VarianceOfRows(const LineSpeckle& speckle, const std::vector<double>& of_row, int columns,
                      int step, int first_row_px, double pixel_pitch_m) {
  const auto rows = static_cast<int>(of_row.size());
  const int lag = speckle.max_lag();
  std::vector<std::vector<double>> of_means(speckle.places());  // by distance
  for (int place = 0; place < speckle.places(); ++place) {
    for (int distance = 0; distance <= lag; ++distance) {
      of_means[place].push_back(CovarianceOfMeans(speckle.At(place), distance, columns, step, 0));
    }
  }
  double variance = 0;
  for (int row = 0; row < rows; ++row) {
    if (of_row[row] == 0) continue;
    const int place = speckle.PlaceOf((first_row_px + row) * pixel_pitch_m);
    for (int other = row; other < std::min(rows, row + lag + 1); ++other) {
      variance +=
          (other == row ? 1 : 2) * of_row[row] * of_row[other] * of_means[place][other - row];
    }
  }
  return std::max(0.0, variance);
}

}  // namespace sightline
