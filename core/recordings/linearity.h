// SPDX-License-Identifier: Apache-2.0
// Tests if numbers are proportional to light, without a model of the image.
#pragma once

#include <optional>
#include <vector>

#include "core/image/image.h"
#include "core/recordings/recordings.h"

namespace sightline {

// Exponents of power laws; 1 for raw numbers.
struct Linearity {
  // Temporal variance against signal, from pairs of equal recordings of the same speckle, where
  // photon noise is at least three quarters of it: 0.75 to 1 (EMVA 1288, photon transfer). Numbers
  // encoded as y ~ x^(1/g): 2 - g, so about 0 at g = 2 and below it at 2.2.
  std::optional<double> noise_exponent;
  double noise_exponent_error = 0;  // standard error
  // Signal against exposure time, same speckle and optics. Encoded: about 1/g.
  std::optional<double> exposure_exponent;
};

// Unset where the recordings have no such pairs, or their signals differ by less than a factor of
// three. `full_dn`: no larger numbers occur.
Linearity MeasureLinearity(const RecordingSet& set, const std::vector<Image<uint16_t>>& raw_dn,
                           double dark_level_dn, double full_dn);

// Exponent of the noise variance against the level in single images, where there are no pairs: by
// second differences along the rows, beside and on the line, where it is not clipped. Shot noise of
// raw numbers has 1, of numbers encoded as y ~ x^(1/g) 2 - g, so -0.2 at 2.2. Speckle and texture
// have 2 either way.
struct SingleImageNoise {
  double exponent = 0, standard_error = 0;  // jackknife over up to ten groups of recordings
};
// nullopt: fewer than four recordings, or levels that differ by less than a factor of three.
std::optional<SingleImageNoise> MeasureSingleImageNoise(const RecordingSet& set,
                                                        const std::vector<Image<uint16_t>>& raw_dn,
                                                        double full_dn);

}  // namespace sightline
