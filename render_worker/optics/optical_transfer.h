// SPDX-License-Identifier: Apache-2.0
// Incoherent optical transfer function of a pupil as a table, for images.
#pragma once

#include <complex>

#include "core/image/image.h"
#include "render_worker/optics/pupil.h"

namespace sightline {

// As OpticalTransfer, but fast for many frequencies: closed form for the clear circle, else
// bilinear in a table of the pupil's autocorrelation (kSamples across the pupil; error below 3e-3).
class OpticalTransferTable {
 public:
  OpticalTransferTable(const Pupil& pupil, double wavelength_m, double image_distance_m);
  std::complex<float> At(double qx_per_m, double qy_per_m) const;

 private:
  static constexpr int kSamples = 256;
  double scale_m2_;  // pupil shift of a frequency, lambda b
  double radius_m_;
  double outer_m_;
  bool clear_circle_;
  Image<std::complex<float>> table_;  // autocorrelation at shifts (i, j) - kSamples steps
};

}  // namespace sightline
