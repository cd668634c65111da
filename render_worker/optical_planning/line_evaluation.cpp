// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/line_evaluation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/laser_line/merge_exposures.h"
#include "core/laser_line/ridge_score.h"
#include "core/status/status_macros.h"
#include "render_worker/plate/line_width.h"
#include "render_worker/sensor/expose.h"

namespace sightline {
namespace {

// Scales beyond which the ridge filter does not go [px of a plane].
constexpr double kLeastSigma = 0.7, kMostSigma = 20;
// Standard deviations of dark noise's ridge score that make a line.
constexpr double kNoiseDeviations = 6;

}  // namespace

DetectionPlan PlanDetection(const FrameSetup& frame, const LineDetector& detector) {
  const Sensor& sensor = frame.sensor;
  DetectionPlan plan;
  plan.method = detector.method;
  const bool mono = sensor.colour_filter == ColourFilter::kMono;
  const int channel =
      mono ? 0 : detector.channel.value_or(MostSensitiveChannel(sensor, frame.laser.wavelength_m));
  for (const PixelPlane& plane : PixelPlanes(sensor)) {
    if (mono || sensor.ChannelAt(frame.roi.row_px + plane.first_row,
                                 frame.roi.column_px + plane.first_column) == channel) {
      plan.planes.push_back(plane);
    }
  }
  const double step = plan.planes[0].step;
  LaserLineOptions& options = plan.options;
  options.ridge_sigma_px = detector.ridge_sigma_px.value_or(
      std::clamp(NominalWidthPx(frame) / step, kLeastSigma, kMostSigma));
  const double noise_dn =
      std::hypot(sensor.gain_dn_per_electron * sensor.dark_noise_electrons, std::sqrt(1 / 12.0));
  options.min_ridge_score_dn = detector.min_ridge_score_dn.value_or(
      kNoiseDeviations * noise_dn * RidgeNoise(options.ridge_sigma_px));
  // The pixel may be full before the converter is.
  options.saturation_dn =
      std::min(sensor.largest_dn(),
               std::floor(sensor.gain_dn_per_electron * sensor.saturation_capacity_electrons +
                          sensor.black_level_dn));
  options.background_dn = std::numeric_limits<double>::quiet_NaN();
  options.max_lines = detector.max_lines;
  return plan;
}

absl::StatusOr<DetectedLine> DetectLine(const Image<uint16_t>& raw_dn, const DetectionPlan& plan) {
  DetectedLine detected;
  for (const PixelPlane& plane : plan.planes) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto points, DetectLaserLine(PlaneValues(raw_dn, plane), plan.options, plan.method));
    for (LinePoint& point : points) {
      point.column_px = plane.first_column + plane.step * point.column_px;
      point.row_px = plane.first_row + plane.step * point.row_px;
      point.width_px *= plane.step;
    }
    detected.planes.push_back(std::move(points));
  }
  return detected;
}

DetectedLine MergeExposures(const DetectedLine& long_exposure, const DetectedLine& short_exposure,
                            double apart_px) {
  DetectedLine merged;
  for (size_t p = 0; p < long_exposure.planes.size(); ++p) {
    merged.planes.push_back(
        MergeExposures(long_exposure.planes[p], short_exposure.planes[p], apart_px));
  }
  return merged;
}

std::vector<LineSums> JudgeLine(const DetectedLine& detected, const DetectionPlan& plan,
                                const std::vector<LineCrossing>& line, int columns_px,
                                double reach_px) {
  std::vector<LineSums> sums;
  for (size_t p = 0; p < plan.planes.size(); ++p) {
    const PixelPlane& plane = plan.planes[p];
    // In columns of the plane.
    std::vector<LineCrossing> crossings;
    for (const LineCrossing& crossing : line) {
      if (crossing.column_px % plane.step != plane.first_column) continue;
      crossings.push_back({crossing.column_px / plane.step, crossing.row_px});
    }
    std::vector<LinePoint> points = detected.planes[p];
    for (LinePoint& point : points) point.column_px /= plane.step;
    const int columns = (columns_px - plane.first_column + plane.step - 1) / plane.step;
    const std::vector<LineSums> blocks =
        CompareLine(points, crossings, columns, kBlockColumns_px / plane.step, reach_px);
    sums.insert(sums.end(), blocks.begin(), blocks.end());
  }
  return sums;
}

std::vector<std::vector<size_t>> CrossingsOfBlocks(const DetectionPlan& plan,
                                                   const std::vector<LineCrossing>& line,
                                                   int columns_px) {
  std::vector<std::vector<size_t>> blocks;
  for (const PixelPlane& plane : plan.planes) {
    const size_t first = blocks.size();
    const int columns = (columns_px - plane.first_column + plane.step - 1) / plane.step;
    const int block_columns = kBlockColumns_px / plane.step;
    blocks.resize(first + static_cast<size_t>((columns + block_columns - 1) / block_columns));
    for (size_t i = 0; i < line.size(); ++i) {
      if (line[i].column_px % plane.step != plane.first_column) continue;
      blocks[first + static_cast<size_t>(line[i].column_px / plane.step / block_columns)].push_back(
          i);
    }
  }
  return blocks;
}

absl::StatusOr<DetectedLine> ExposeAndDetect(const PixelIrradiance& light, const FrameSetup& frame,
                                             std::span<const ActiveEffect> effects,
                                             const DetectionPlan& plan) {
  if (!effects.empty()) {
    return DetectLine(ReadOut(light, frame, effects, /*previous_mean_electrons=*/nullptr).raw_dn,
                      plan);
  }
  Image<uint16_t> raw(frame.roi.columns_px, frame.roi.rows_px);
  for (const PixelPlane& plane : plan.planes) {
    const Image<double> electrons =
        CollectElectrons(MeanPhotoElectrons(light, frame, &plane), frame, &plane);
    const Image<uint16_t> numbers = Digitise(electrons, frame.sensor);
    if (plan.planes.size() == 1) {
      raw = numbers;
      break;
    }
    for (int row = plane.first_row; row < raw.rows_px; row += plane.step) {
      for (int column = plane.first_column; column < raw.columns_px; column += plane.step) {
        raw.At(row, column) = numbers.At(row, column);
      }
    }
  }
  return DetectLine(raw, plan);
}

}  // namespace sightline
