// SPDX-License-Identifier: Apache-2.0
#include "render_worker/verification/line_statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/laser_line/detect_laser_line.h"
#include "core/laser_line/ridge_score.h"
#include "core/status/status_macros.h"

namespace sightline {
std::vector<ColourChannel> ColourChannels(const Sensor& sensor) {
  const std::vector<PixelPlane> planes = PixelPlanes(sensor);
  if (sensor.colour_filter == ColourFilter::kMono) return {{"mono", planes}};
  std::vector<ColourChannel> channels = {{"red", {}}, {"green", {}}, {"blue", {}}};
  for (const PixelPlane& plane : planes) {
    channels[sensor.ChannelAt(plane.first_row, plane.first_column)].planes.push_back(plane);
  }
  return channels;
}

double AverageProfile::Peak() const {
  return mean_dn.empty() ? 0 : *std::max_element(mean_dn.begin(), mean_dn.end());
}

AverageProfile AverageAlongLine(const Image<uint16_t>& raw_dn, const ColourChannel& channel) {
  AverageProfile profile;
  for (int row = 0; row < raw_dn.rows_px; ++row) {
    double sum = 0;
    int count = 0;
    for (const PixelPlane& plane : channel.planes) {
      if (row % plane.step != plane.first_row) continue;
      const uint16_t* values = raw_dn.Row(row);
      for (int column = plane.first_column; column < raw_dn.columns_px; column += plane.step) {
        sum += values[column];
        ++count;
      }
    }
    if (count == 0) continue;
    profile.row_px.push_back(row);
    profile.mean_dn.push_back(sum / count);
  }
  return profile;
}

absl::StatusOr<LineScatter> DetectLineScatter(const Image<uint16_t>& raw_dn,
                                              const ColourChannel& channel,
                                              const FrameSetup& frame) {
  const Sensor& sensor = frame.sensor;
  const double noise_dn =
      std::hypot(sensor.gain_dn_per_electron * sensor.dark_noise_electrons, std::sqrt(1 / 12.0));
  std::vector<double> rows;
  int columns = 0;
  for (const PixelPlane& plane : channel.planes) {
    const Image<float> values = PlaneValues(raw_dn, plane);
    if (values.empty()) continue;
    columns += values.columns_px;
    LaserLineOptions options;
    options.ridge_sigma_px = std::clamp(NominalWidthPx(frame) / plane.step, 0.7, 20.0);
    options.min_ridge_score_dn = 6 * noise_dn * RidgeNoise(options.ridge_sigma_px);
    options.saturation_dn = sensor.largest_dn();
    options.background_dn = std::numeric_limits<double>::quiet_NaN();
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto points,
        DetectLaserLine(values, options, LaserLineMethod::kStegerCentreOfGravity));
    for (const LinePoint& point : points) {
      rows.push_back(plane.first_row + plane.step * point.row_px);
    }
  }
  LineScatter scatter;
  if (rows.size() < 2) return scatter;
  const double count = static_cast<double>(rows.size());
  scatter.found_fraction = count / columns;
  scatter.mean_row_px = std::accumulate(rows.begin(), rows.end(), 0.0) / count;
  double squares = 0;
  for (const double row : rows)
    squares += (row - scatter.mean_row_px) * (row - scatter.mean_row_px);
  scatter.u_px = std::sqrt(squares / (count - 1));
  return scatter;
}

double HeightUncertainty(double u_px, const FrameSetup& frame) {
  const double magnification = frame.ImageDistance() / frame.plate.camera_distance_m;
  return u_px * frame.sensor.pixel_pitch_m /
         (magnification * std::tan(frame.plate.incidence_angle_rad));
}

}  // namespace sightline
