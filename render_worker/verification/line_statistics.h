// SPDX-License-Identifier: Apache-2.0
// Statistics of a laser line in an image by the definitions of chapter 5 of the thesis.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "render_worker/frame/frame_setup.h"
#include "render_worker/recordings/profile_bins.h"
#include "render_worker/sensor/pixel_planes.h"

namespace sightline {

// Pixels of one colour: one plane, or the two of green.
struct ColourChannel {
  std::string name;  // "mono", "red", "green", "blue"
  std::vector<PixelPlane> planes;
};
std::vector<ColourChannel> ColourChannels(const Sensor& sensor);

// Average along the line (section 5.4.1): mean over the columns of every row that has pixels of the
// channel.
struct AverageProfile {
  std::vector<int> row_px;  // from the image's first row
  std::vector<double> mean_dn;

  double Peak() const;  // [DN]; 0 if empty
};
AverageProfile AverageAlongLine(const Image<uint16_t>& raw_dn, const ColourChannel& channel);

// Detected row of the line, column by column (section 5.4.2).
struct LineScatter {
  double found_fraction = 0;  // of the columns
  double mean_row_px = 0;
  double u_px = 0;  // standard deviation of the row over the columns

  // True if enough columns show a line; fewer are uninformative.
  bool found() const { return found_fraction >= 0.5; }
};

// Detection as in thesis appendix A, at the scale of the nominal line's image. A line must exceed
// the response to dark noise alone by six standard deviations. `frame` supplies the scale, the
// noise and the saturation; rows count from the image's first row.
absl::StatusOr<LineScatter> DetectLineScatter(const Image<uint16_t>& raw_dn,
                                              const ColourChannel& channel,
                                              const FrameSetup& frame);

// Height that corresponds to an image uncertainty, u p / (m tan(theta)) with m = b / d_c (eq. 5.9,
// which has theta = 45 degrees and f for b).
double HeightUncertainty(double u_px, const FrameSetup& frame);

}  // namespace sightline
