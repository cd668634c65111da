// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/hot_pixels.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include "core/statistics/order_statistics.h"
#include "render_worker/recordings/profile_bins.h"

namespace sightline {

namespace {

// Standard deviations of an outlier. Chosen: normal noise has none in any image.
constexpr double kHotPixelOutlier = 8;
// Standard deviations up to which a neighbour is none. Chosen: speckle and charge that spreads have
// neighbours above it.
constexpr double kUsual = 5;
// Interquartile range of the standard normal distribution.
constexpr double kNormalQuartiles = 1.349;
// Least standard deviation [DN]: values are rounded.
constexpr double kRounded_dn = 0.5;
// Pixels of a row that quartiles need. Chosen.
constexpr size_t kFewPixelsOfRow = 16;

using SensorPixel = std::pair<int, int>;  // row, column

// Rows of a plane without laser light.
std::vector<int> UnlitRows(const RecordedFrame& recorded, const PixelPlane& plane) {
  const double centre_px = NominalLineRow(recorded.nominal);
  const double lit_px = recorded.plate_position_id < 0 ? 0 : UnlitDistancePx(recorded.nominal);
  std::vector<int> rows;
  for (int row = plane.first_row; row < recorded.raw_dn.rows_px; row += plane.step) {
    if (lit_px == 0 || std::abs(row - centre_px) > lit_px) rows.push_back(row);
  }
  return rows;
}

// Adds the isolated outliers of one plane of a recording.
void FindHotPixels(const RecordedFrame& recorded, const PixelPlane& plane,
                   std::set<SensorPixel>& found) {
  const Image<uint16_t>& raw = recorded.raw_dn;
  const RegionOfInterest& roi = recorded.nominal.roi;
  for (int row : UnlitRows(recorded, plane)) {
    std::vector<double> values;
    for (int c = plane.first_column; c < raw.columns_px; c += plane.step) {
      values.push_back(raw.At(row, c));
    }
    if (values.size() < kFewPixelsOfRow) continue;
    std::vector<double> sorted = values;
    std::sort(sorted.begin(), sorted.end());
    const size_t n = sorted.size();
    const double median = QuantileBeforeRounding(sorted, 0.5);
    const double quartiles =
        QuantileBeforeRounding(sorted, 0.75) - QuantileBeforeRounding(sorted, 0.25);
    const double deviation = std::max(kRounded_dn, quartiles / kNormalQuartiles);
    const auto stands_out = [&](size_t i, double limit) {
      return std::abs(values[i] - median) > limit * deviation;
    };
    for (size_t i = 0; i < n; ++i) {
      if (!stands_out(i, kHotPixelOutlier)) continue;
      const bool alone =
          (i == 0 || !stands_out(i - 1, kUsual)) && (i + 1 == n || !stands_out(i + 1, kUsual));
      const int column = plane.first_column + static_cast<int>(i) * plane.step;
      if (alone) found.emplace(roi.row_px + row, roi.column_px + column);
    }
  }
}

}  // namespace

RecordedSet WithoutHotPixels(const RecordedSet& set) {
  RecordedSet cleaned = set;
  if (set.frames.empty() || set.frames.front().raw_dn.values.empty()) return cleaned;
  const std::vector<PixelPlane> planes = PixelPlanes(set.frames.front().nominal.sensor);
  const int step = planes.front().step;
  std::set<SensorPixel> hot;
  for (const RecordedFrame& recorded : set.frames) {
    for (const PixelPlane& plane : planes) FindHotPixels(recorded, plane, hot);
  }
  for (RecordedFrame& recorded : cleaned.frames) {
    const RegionOfInterest& roi = recorded.nominal.roi;
    Image<uint16_t>& raw = recorded.raw_dn;
    for (const auto& [sensor_row, sensor_column] : hot) {
      const int row = sensor_row - roi.row_px, column = sensor_column - roi.column_px;
      if (row < 0 || row >= raw.rows_px || column < 0 || column >= raw.columns_px) continue;
      double sum = 0;
      int count = 0;
      for (const int c : {column - step, column + step}) {
        if (c < 0 || c >= raw.columns_px || hot.contains({sensor_row, c + roi.column_px})) continue;
        sum += raw.At(row, c);
        ++count;
      }
      if (count > 0) raw.At(row, column) = static_cast<uint16_t>(std::lround(sum / count));
    }
  }
  return cleaned;
}

}  // namespace sightline
