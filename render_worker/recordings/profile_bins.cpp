// SPDX-License-Identifier: Apache-2.0
#include "render_worker/recordings/profile_bins.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "render_worker/plate/plate_scene.h"

namespace sightline {

namespace {

// Outer edges of the bins on one side of the line [px].
std::vector<double> BinEdges(double width_px, double farthest_px) {
  std::vector<double> edges;
  const double narrow = std::max(1.0, 0.5 * width_px);
  double edge = narrow / 2;
  while (edge < 3 * width_px) {
    edges.push_back(edge);
    edge += narrow;
  }
  double step = narrow;
  while (edge < farthest_px) {
    edges.push_back(edge);
    step *= 1.6;
    edge += step;
  }
  edges.push_back(1e9);
  return edges;
}

}  // namespace

double NominalLineRow(const FrameSetup& frame) {
  return frame.ImageDistance() / frame.plate.camera_distance_m * frame.plate.line_offset_m /
             frame.sensor.pixel_pitch_m -
         frame.roi.row_px;
}

double UnlitDistancePx(const FrameSetup& frame) { return 8 * NominalWidthPx(frame) + 40; }

std::vector<ProfileBin> MakeProfileBins(const RecordedFrame& recorded,
                                        const std::vector<PixelPlane>& planes) {
  const FrameSetup& frame = recorded.nominal;
  std::vector<ProfileBin> bins;
  const int rows_px = frame.roi.rows_px;
  const double centre_px = NominalLineRow(frame);
  const double farthest_px = std::max(centre_px, rows_px - centre_px);
  std::vector<double> edges = {1e9};
  if (recorded.plate_position_id >= 0) edges = BinEdges(NominalWidthPx(frame), farthest_px);
  for (size_t plane = 0; plane < planes.size(); ++plane) {
    std::map<int, ProfileBin> by_index;
    for (int row = planes[plane].first_row; row < rows_px; row += planes[plane].step) {
      const double offset_px = row - centre_px;
      const int edge = static_cast<int>(
          std::upper_bound(edges.begin(), edges.end(), std::abs(offset_px)) - edges.begin());
      by_index[offset_px < 0 ? -edge : edge].rows.push_back(row);
    }
    for (auto& [index, bin] : by_index) {
      bin.plane = static_cast<int>(plane);
      for (int row : bin.rows) bin.centre_px += (row - centre_px) / bin.rows.size();
      bins.push_back(std::move(bin));
    }
  }
  return bins;
}

}  // namespace sightline
