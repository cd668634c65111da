// SPDX-License-Identifier: Apache-2.0
// Mean numbers that a sensor gives for noisy charge: rounded, cut off at both ends, converted.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "render_worker/effects/effect.h"

namespace sightline {

class MeanNumbers {
 public:
  // `frame`: of a column sample, after the effects on it.
  MeanNumbers(const FrameSetup& frame, std::span<const ActiveEffect> effects);

  // Variance of rounding to the numbers that occur (EMVA 1288 R4.0, section 2.3) [DN^2].
  double rounding_variance_dn2() const { return rounding_variance_dn2_; }
  // Step of the numbers where all are multiples of it, as missing bits leave them; else 1.
  int step_dn() const { return step_dn_; }

  // Mean number of every pixel whose charge has this mean, `noise_dn` its standard deviation as a
  // number. Where it differs from that of the first call by little of the noise, it is taken as
  // linear in the charge.
  // `spread_dn2`: variance of the mean among pixels that are expected together. Rounding errors
  // average out where it or the noise is wide.
  Image<float> Of(const Image<double>& electrons, const Image<float>& noise_dn,
                  const Image<double>& spread_dn2);

 private:
  // Mean of a normal number after it is cut off, and its slope with the number's mean.
  struct CutOff {
    double mean = 0, slope = 1;
  };
  struct Reference {
    double number = 0;
    CutOff cut_off;
  };
  CutOff MeanCutOff(double mean, double deviation, double top) const;
  float MeanConversion(float mean, float deviation) const;
  void AddRoundingErrors(const Image<double>& electrons, const Image<float>& noise_dn,
                         const Image<double>& spread_dn2, Image<float>* numbers) const;

  double gain_dn_per_electron_, black_level_dn_, rounding_variance_dn2_;
  int step_dn_ = 1;
  Image<double> plateau_dn_;          // of a full pixel
  std::vector<uint16_t> converted_;   // of every number; empty: all stay as they are
  std::vector<Reference> reference_;  // of the first call
};

}  // namespace sightline
