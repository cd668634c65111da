// SPDX-License-Identifier: Apache-2.0
// Raw numbers on the paper and on the print of a checkerboard, by their distance from the laser
// line. Paper and print receive the same light but reflect different fractions of it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/image/image.h"
#include "core/scanner_calibration/rig_adjustment.h"

namespace sightline {

struct BoardTile {
  bool print = false;       // a dark square
  double raw_dn = 0;        // mean
  double variance_dn2 = 0;  // of single pixels, from second differences
  double from_line_m = 0;   // on the board
};

// Light close to the line, at one place along it.
struct LineSide {
  Eigen::Vector2d image_px;  // of the line
  double raw_dn = 0;         // mean of both sides
};

struct FrameTiles {
  std::vector<BoardTile> tiles;
  std::vector<LineSide> sides;
};

// Tiles are ninths of squares, without their borders. Tiles with clipped pixels, tiles nearer to
// the line than `least_distance_m` and tiles beyond the image are left out. Sides are means over
// 1.5 to 2.5 times `least_distance_m` from the line on the image, on paper or print.
FrameTiles MeasureTiles(const Image<uint16_t>& image, double saturation_dn,
                        const TargetBoard& board, const Eigen::VectorXd& shared,
                        const Eigen::VectorXd& pose, const LineInFrame& line,
                        double least_distance_m);

}  // namespace sightline
