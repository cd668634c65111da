// SPDX-License-Identifier: Apache-2.0
// From the light on the pixels to how well the laser line is found: sensor and detection.
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

// `frame`: the setting, with its plate.camera_distance_m at the line. The channel defaults to the
// one with the highest quantum efficiency at the laser's wavelength, the scale to the width of the
// line's image (NominalWidthPx), the threshold to six standard deviations of what dark noise and
// quantisation alone would score.
DetectionPlan PlanDetection(const FrameSetup& frame, const LineDetector& detector);

// Detected points of all planes; columns and rows in pixels of the region. Points of a plane come
// by ascending column, plane after plane.
struct DetectedLine {
  std::vector<std::vector<LinePoint>> planes;
};
absl::StatusOr<DetectedLine> DetectLine(const Image<uint16_t>& raw_dn, const DetectionPlan& plan);

// Merges two exposures (MergeExposures), plane by plane.
DetectedLine MergeExposures(const DetectedLine& long_exposure, const DetectedLine& short_exposure,
                            double apart_px);

// Columns that are evaluated together; speckle and the detection's window reach less far.
inline constexpr int kBlockColumns_px = 32;

// Detected points against the true line, block by block of every plane.
std::vector<LineSums> JudgeLine(const DetectedLine& detected, const DetectionPlan& plan,
                                const std::vector<LineCrossing>& line, int columns_px,
                                double reach_px);

// For every block of JudgeLine, in its order, the crossings (indices into `line`) that it counts.
std::vector<std::vector<size_t>> CrossingsOfBlocks(const DetectionPlan& plan,
                                                   const std::vector<LineCrossing>& line,
                                                   int columns_px);

// Reads out one exposure and detects its line. With no effects only the planes that are looked at
// are computed; their numbers are the same.
absl::StatusOr<DetectedLine> ExposeAndDetect(const PixelIrradiance& light, const FrameSetup& frame,
                                             std::span<const ActiveEffect> effects,
                                             const DetectionPlan& plan);

}  // namespace sightline
