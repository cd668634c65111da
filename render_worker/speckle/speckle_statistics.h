// SPDX-License-Identifier: Apache-2.0
// Second-order statistics of fully developed speckle on pixels (Goodman, Speckle Phenomena in
// Optics, 2nd ed., sections 4.4 and 4.7).
#pragma once

#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "core/image/image.h"
#include "render_worker/optics/pupil.h"

namespace sightline {

// Smallest squared contrast; without any speckle its distribution would be undefined.
inline constexpr double kLeastContrastSquared = 1e-6;

// Transmission of each position in the pupil towards one position in the image; 1 everywhere for a
// uniformly lit object.
using PupilWeight = std::function<double(double x_m, double y_m)>;

// Covariance of the irradiance of two pixels over the product of their means, by their distance in
// pixels: At(rows, columns). At(0, 0) is the squared contrast 1/M. For one polarised pattern: the
// squared field correlation |mu|^2 averaged over the two pixels, mu the Fourier transform of the
// light's distribution over the pupil (van Cittert and Zernike).
class SpecklePixelCovariance {
 public:
  SpecklePixelCovariance(const Pupil& pupil, const PupilWeight& weight, double wavelength_m,
                         double image_distance_m, double pixel_pitch_m, int max_lag);
  // `values` by lag, row by row; zero beyond the reaches.
  SpecklePixelCovariance(int max_lag, int row_reach, int column_reach, std::vector<double> values)
      : max_lag_(max_lag),
        row_reach_(row_reach),
        column_reach_(column_reach),
        values_(std::move(values)) {}

  double At(int rows, int columns) const;
  int max_lag() const { return max_lag_; }
  // Covariance if pixels exchange fractions of light with the pixels around them. `shares`: odd
  // sizes, the pixel itself in the middle; relative to the total.
  SpecklePixelCovariance Shared(const Image<double>& shares) const;

 private:
  int max_lag_ = 0;
  int row_reach_ = 0, column_reach_ = 0;
  std::vector<double> values_;
};

// The same for a line across the image, which lights the pupil unevenly when it is out of focus. At
// the line's flank light comes from one side of the pupil only, so speckle is longer across the
// line than along it.
class LineSpeckle {
 public:
  // `ideal`: irradiance across the line, sampled every sample_pitch_m from first_v_m on;
  // `blur_per_pupil` = b (1/b' - 1/b): shift of the image by place in the pupil.
  LineSpeckle(const Pupil& pupil, double wavelength_m, double image_distance_m,
              double blur_per_pupil, double pixel_pitch_m, const std::vector<double>& ideal,
              double first_v_m, double sample_pitch_m);

  int places() const { return static_cast<int>(places_->size()); }
  // Index of the position that represents v.
  int PlaceOf(double v_m) const;
  const SpecklePixelCovariance& At(int place) const { return (*places_)[place]; }
  int max_lag() const { return places_->front().max_lag(); }
  double PlaceCentre_m(int place) const {
    const int middle = (places() - 1) / 2;
    return centre_m_ + (place - middle) * spacing_m_;
  }
  // The same line with other covariances, one per position.
  LineSpeckle With(std::vector<SpecklePixelCovariance> covariances) const;

 private:
  double centre_m_ = 0, spacing_m_ = 1;
  std::shared_ptr<const std::vector<SpecklePixelCovariance>> places_;  // shared by equal lines
};

// Covariance of the means of two rows `distance` apart, over the product of their expectations. The
// means are over `columns` pixels, `step` apart; the second row is `phase` columns to the right.
double CovarianceOfMeans(const SpecklePixelCovariance& pixel, int distance, int columns, int step,
                         int phase);

// Variance due to speckle of the sum over rows with expectations `of_row`. Each row is the mean of
// `columns` pixels, `step` apart. First row: first_row_px of the sensor.
double VarianceOfRows(const LineSpeckle& speckle, const std::vector<double>& of_row, int columns,
                      int step, int first_row_px, double pixel_pitch_m);

}  // namespace sightline
