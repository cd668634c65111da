// SPDX-License-Identifier: Apache-2.0
// Deviations of the detected laser line from the true one, as rendered images of an artefact show
// them: for places along the scan and columns of the image, relative to a reference place of the
// surface, in several realisations of speckle and noise.
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
    double stage_m = 0;    // relative to that of the reference place
    int first_column = 0;  // relative to that of the reference place
    std::vector<Realisation> realisations;
  };

  // `repeats`: columns and frames beyond those rendered take the deviations of rendered ones, as
  // on a plate, where all are alike. Every frame has equally many realisations.
  LineDeviations(std::vector<Frame> frames, bool repeats);

  int realisations() const;
  // Deviation in the frame nearest to `stage_m`. Empty where the line was not detected.
  std::optional<double> At(double stage_m, int column, int realisation) const;
  // Mean over the realisations and how many there are.
  struct Mean {
    double deviation_px = 0;
    int count = 0;
  };
  Mean MeanAt(double stage_m, int column) const;

 private:
  const Frame& Nearest(double stage_m) const;

  std::vector<Frame> frames_;  // by stage position
  bool repeats_;
};

}  // namespace sightline
