// SPDX-License-Identifier: Apache-2.0
// Mean raw values of a sensor for noisy charge: rounded, clipped at both ends, converted.
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

  // Variance of rounding to the raw values that occur (EMVA 1288 R4.0, section 2.3) [DN^2].
  double rounding_variance_dn2() const { return rounding_variance_dn2_; }
  // Common divisor of all raw values, e.g. because of missing bits; else 1.
  int step_dn() const { return step_dn_; }

  // Mean raw value of every pixel with the given mean charge and noise `noise_dn` (standard
  // deviation). If the charge differs from that of the first call by a small part of the
  // noise, the result is linearised in the charge. `spread_dn2`: variance of the mean among
  // pixels of a common expectation. Rounding errors average out if this variance or the noise
  // is large.
  Image<float> Of(const Image<double>& electrons, const Image<float>& noise_dn,
                  const Image<double>& spread_dn2);

 private:
  // Mean of a clipped normal variable, and its derivative by the variable's mean.
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
  Image<double> plateau_dn_;          // of a saturated pixel
  std::vector<uint16_t> converted_;   // for every raw value; empty: unchanged
  std::vector<Reference> reference_;  // of the first call
};

}  // namespace sightline
