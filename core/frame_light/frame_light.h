// SPDX-License-Identifier: Apache-2.0
// Measures the light beside the laser line in frames of a checkerboard with unknown exposure,
// f-number and gain, in which the line may be clipped.
//
// - Halo: dark squares reflect less than light ones. Light that falls on the board is weaker on
//   them by the ratio of the reflectances; light that lens or sensor spread is not.
// - Light at fixed places of the image comes from what moves with the scanner.
// - Noise against level: shot noise of linear numbers has a variance in proportion to the level.
//
// All are compared between frames, so that errors come from repeated frames (jackknife).
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/frame_light/board_tiles.h"

namespace sightline {

struct HaloBin {
  double from_line_m = 0, paper_dn = 0, print_dn = 0;  // means over frames
};

struct AlongLineBin {
  double along_px = 0;
  double relative = 0, relative_sd = 0;  // to the frame's median; standard deviation of frames
};

struct BrightPlace {
  Eigen::Vector2d image_px;  // middle of its blocks
  int block_count = 0;       // of 32 x 32 px, clipped in at least half of the frames
  int frame_count = 0;       // frames in which the most frequent block is clipped
};

struct FrameLight {
  int frame_count = 0, tile_count = 0;
  std::vector<HaloBin> halo;
  // Change of the print's raw numbers over that of the paper's at equal distances from the line.
  double print_over_paper = 0, print_over_paper_error = 0;
  // Root mean square prediction errors of tiles in left-out frames [DN] by three models: constants
  // only; a halo equal on paper and print (lens, sensor); a halo in proportion to the reflectance.
  double even_rms_dn = 0, lens_rms_dn = 0, board_rms_dn = 0;
  std::vector<AlongLineBin> along_line;
  double along_line_correlation = 0;                    // between frames, mean over pairs
  std::vector<BrightPlace> bright;                      // none or one
  double noise_exponent = 0, noise_exponent_error = 0;  // variance ~ level^exponent
  double clipped_fraction = 0;                          // of the line
};

// Takes one frame after the other, so that only one image is in memory.
class FrameLightSums {
 public:
  void Add(const Image<uint16_t>& image, double saturation_dn, const LineInFrame& line,
           FrameTiles tiles);
  // Fewer than four frames or 100 tiles give an empty result (frame_count 0).
  FrameLight Result() const;

 private:
  struct Frame {
    FrameTiles tiles;
    std::vector<bool> bright_blocks;
    double clipped_fraction = 0;
    bool along_columns = true;
  };
  std::vector<Frame> frames_;
  int columns_px_ = 0, rows_px_ = 0;
};

// Sentences for people: what the frames show, and what they cannot show with the reason.
std::vector<std::string> LightFindings(const FrameLight& light);
std::vector<std::string> NotDetermined(const FrameLight& light);

}  // namespace sightline
