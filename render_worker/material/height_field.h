// SPDX-License-Identifier: Apache-2.0
// A measured height field as a map of slopes.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"

namespace sightline {

// Slopes by central differences with bilinear interpolation; the field is mirrored at its edges.
// Coarser levels hold means over 2 x 2 samples, so that a footprint gets the mean slope of its
// area.
class HeightField {
 public:
  // At least 2 x 2 samples.
  HeightField(Image<float> height_m, double sample_pitch_m);

  struct Patch {
    float slope_u = 0;  // mean over the footprint
    float slope_v = 0;
    float relative_height = 0;      // from the mean, in standard deviations
    float lost_slope_variance = 0;  // sum for both slopes, inside the footprint
  };
  // (u, v) on the surface: columns along u, rows along v; any values.
  Patch At(double u_m, double v_m, double footprint_m) const;

  double sample_pitch_m() const { return sample_pitch_m_; }
  double height_deviation_m() const { return height_deviation_m_; }

 private:
  struct Level {
    Image<float> slope_u, slope_v, relative_height, slope_variance;
  };
  Patch AtLevel(size_t level, double column, double row) const;

  double sample_pitch_m_;
  double height_deviation_m_ = 0;
  std::vector<Level> levels_;
};

// Reads a text of heights (one row of samples per line, see core/text/number_table.h for separators
// and decimal signs) or a single-channel image (PNG, TIFF) of 16-bit values, in height_unit_m.
// INVALID_ARGUMENT names `context`, the file and the line; NOT_FOUND.
absl::StatusOr<HeightField> ReadHeightField(const std::string& path, double sample_pitch_m,
                                            double height_unit_m, const std::string& context);

}  // namespace sightline
