// SPDX-License-Identifier: Apache-2.0
#include "render_worker/effects/plate_profile.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

constexpr int kLargestLength = 1 << 16;
// Pixels beyond the region of interest: across the line more than point spreads reach, along it as
// far as the line changes.
constexpr int kMargin_px = 512;
constexpr int kMarginAlong_px = 64;
constexpr int kColumnPitch_px = 8;

}  // namespace

PlateProfile::PlateProfile(const PlateFunction& function, const FrameSetup& frame,
                           bool constant_along_line, double finest_m) {
  const double pixel_m =
      frame.sensor.pixel_pitch_m * frame.plate.camera_distance_m / frame.ImageDistance();
  first_s_m_ = (frame.roi.row_px - kMargin_px) * pixel_m;
  const double length = (frame.roi.rows_px + 2 * kMargin_px) * pixel_m;
  step_m_ = std::max(finest_m / 16, length / kLargestLength);
  const auto rows = static_cast<size_t>(length / step_m_) + 1;
  first_x_m_ = (frame.roi.column_px - kMarginAlong_px) * pixel_m;
  step_x_m_ = kColumnPitch_px * pixel_m;
  const size_t columns =
      constant_along_line
          ? 1
          : static_cast<size_t>(frame.roi.columns_px + 2 * kMarginAlong_px) / kColumnPitch_px + 2;
  columns_.assign(columns, std::vector<double>(rows));
  for (size_t column = 0; column < columns; ++column) {
    const double x_m =
        constant_along_line ? 0.0 : first_x_m_ + static_cast<double>(column) * step_x_m_;
    for (size_t row = 0; row < rows; ++row) {
      columns_[column][row] = function(x_m, first_s_m_ + static_cast<double>(row) * step_m_);
    }
  }
}

void PlateProfile::SpreadExponentially(double spread_m) {
  const double ratio = std::exp(-step_m_ / spread_m);
  const double centre = 1 - std::exp(-0.5 * step_m_ / spread_m);
  const double neighbour = 0.5 * std::exp(-0.5 * step_m_ / spread_m) * (1 - ratio);
  for (std::vector<double>& column : columns_) {
    std::vector<double> result(column.size());
    double from_before = 0;
    for (size_t i = 0; i < column.size(); ++i) {
      result[i] = centre * column[i] + neighbour * from_before;
      from_before = column[i] + ratio * from_before;
    }
    double from_behind = 0;
    for (size_t i = column.size(); i-- > 0;) {
      result[i] += neighbour * from_behind;
      from_behind = column[i] + ratio * from_behind;
    }
    column = std::move(result);
  }
}

void PlateProfile::SpreadBy(const std::vector<double>& weights) {
  for (std::vector<double>& column : columns_) {
    std::vector<double> result(column.size(), 0.0);
    for (size_t i = 0; i < column.size(); ++i) {
      if (column[i] == 0) continue;
      result[i] += weights[0] * column[i];
      for (size_t k = 1; k < weights.size(); ++k) {
        if (i >= k) result[i - k] += weights[k] * column[i];
        if (i + k < column.size()) result[i + k] += weights[k] * column[i];
      }
    }
    column = std::move(result);
  }
}

double PlateProfile::AtColumn(size_t column, double s_m) const {
  const std::vector<double>& samples = columns_[column];
  const double place = (s_m - first_s_m_) / step_m_;
  if (!(place >= 1) || place >= static_cast<double>(samples.size() - 2)) return 0;
  const auto i = static_cast<size_t>(place);
  const double t = place - static_cast<double>(i);
  // Catmull and Rom.
  const double a = samples[i - 1], b = samples[i], c = samples[i + 1], d = samples[i + 2];
  return std::max(
      0.0, b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))));
}

double PlateProfile::At(double x_m, double s_m) const {
  if (columns_.size() == 1) return AtColumn(0, s_m);
  const double place = std::clamp((x_m - first_x_m_) / step_x_m_, 0.0,
                                  static_cast<double>(columns_.size() - 1) - 1e-9);
  const auto i = static_cast<size_t>(place);
  const double t = place - static_cast<double>(i);
  return (1 - t) * AtColumn(i, s_m) + t * AtColumn(i + 1, s_m);
}

}  // namespace sightline
