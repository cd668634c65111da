// SPDX-License-Identifier: Apache-2.0
// Exposes an image, detects the laser line and measures the quality of the detection.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/optics_planning.h"
#include "core/laser_line/line_quality.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/sensor/pixel_planes.h"

namespace sightline {

// Settings of line detection: planes of the channel, and scale and threshold of the ridge filter.
struct DetectionPlan {
  std::vector<PixelPlane> planes;
  LaserLineOptions options;  // in pixels of a plane
  LaserLineMethod method = LaserLineMethod::kStegerCentreOfGravity;
};

// `frame`: the setting, with its plate.camera_distance_m at the line. Defaults: the channel with
// the highest quantum efficiency at the laser's wavelength, the scale from the width of the line's
// image (NominalWidthPx), and as threshold six standard deviations of the response to dark noise
// and quantisation alone.
DetectionPlan PlanDetection(const FrameSetup& frame, const LineDetector& detector);

// Detected points of all planes; columns and rows in pixels of the region. Sorted by plane, then by
// ascending column.
struct DetectedLine {
  std::vector<std::vector<LinePoint>> planes;
};
absl::StatusOr<DetectedLine> DetectLine(const Image<uint16_t>& raw_dn, const DetectionPlan& plan);

// Merges two exposures (MergeExposures), plane by plane.
DetectedLine MergeExposures(const DetectedLine& long_exposure, const DetectedLine& short_exposure,
                            double apart_px);

// Number of columns evaluated together; speckle and the detection window are shorter.
inline constexpr int kBlockColumns_px = 32;

// Compares detected points with the true line, in each block of every plane.
std::vector<LineSums> JudgeLine(const DetectedLine& detected, const DetectionPlan& plan,
                                const std::vector<LineCrossing>& line, int columns_px,
                                double reach_px);

// For every block of JudgeLine, in its order, the crossings (indices into `line`) that it contains.
std::vector<std::vector<size_t>> CrossingsOfBlocks(const DetectionPlan& plan,
                                                   const std::vector<LineCrossing>& line,
                                                   int columns_px);

// Reads out one exposure and detects its line. Without effects, only the used planes are computed;
// their values are the same.
absl::StatusOr<DetectedLine> ExposeAndDetect(const PixelIrradiance& light, const FrameSetup& frame,
                                             std::span<const ActiveEffect> effects,
                                             const DetectionPlan& plan);

}  // namespace sightline
