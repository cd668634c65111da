// SPDX-License-Identifier: Apache-2.0
// Deviations of the detected laser line from the true one in rendered images of an artefact, by
// position along the scan and column of the image, relative to a reference position on the
// surface.
//
// Every frame has an image without speckle and several realisations with speckle. The first gives
// the systematic error b, the realisations d_r the random errors e_r = d_r - b of whole lines. A
// simulated line is b + sign e_r with equally likely signs and realisations r, so that its mean is
// b for any number of realisations. Without the signs its mean would be that of the few d_r, whose
// random part all tests would share.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace sightline {

class LineDeviations {
 public:
  // Deviations along the column in one image, for columns from `first_column` on; NaN where the
  // line is not detected, or where the sensor has no pixel of the channel.
  struct Realisation {
    std::vector<float> rows_px;
  };
  struct Frame {
    double stage_m = 0;      // relative to that of the reference place
    int first_column = 0;    // relative to that of the reference place
    Realisation systematic;  // in the image without speckle
    std::vector<Realisation> realisations;
  };

  // `repeats`: columns and frames that were not rendered take the deviations of rendered ones, as
  // for a plate, where all are alike. All frames have the same number of realisations.
  LineDeviations(std::vector<Frame> frames, bool repeats);

  int realisations() const;
  // Deviations in the frame nearest to `stage_m`. Empty where the line was not detected.
  std::optional<double> Systematic(double stage_m, int column) const;
  // `sign`: 1 is the deviation in the realisation's image, -1 has the opposite random error.
  std::optional<double> Drawn(double stage_m, int column, int realisation, int sign) const;

 private:
  const Frame& Nearest(double stage_m) const;
  std::optional<double> At(const Frame& frame, const Realisation& line, int column) const;

  std::vector<Frame> frames_;  // by stage position
  bool repeats_;
};

}  // namespace sightline
