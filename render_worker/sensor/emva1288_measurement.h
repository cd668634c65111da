// SPDX-License-Identifier: Apache-2.0
// The measurement procedure of EMVA 1288 (Release 4.0 Linear, sections 6 to 8) on images of a
// camera under uniform light. It evaluates images from any source.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "core/sensor/sensor.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

// A measured value and its standard error (k = 1). With a normal distribution, the true value lies
// within Lower95 to Upper95 with 95 % confidence.
struct Estimate {
  double value = 0;
  double standard_error = 0;

  double Lower95() const { return value - 1.959964 * standard_error; }
  double Upper95() const { return value + 1.959964 * standard_error; }
};

// The pixels of one colour of a raw image of region `roi`; the whole image on mono sensors. Even
// numbers of rows and columns.
Image<uint16_t> ChannelPixels(const Image<uint16_t>& raw_dn, const Sensor& sensor,
                              const RegionOfInterest& roi, int channel);

// Mean and temporal variance from two images under the same conditions (clause 6.6): mean of both,
// half the variance of the difference. The spatial variance is their covariance.
struct PairStatistics {
  double pixels = 0;
  double mean_dn = 0;
  double temporal_variance_dn2 = 0;
  double spatial_variance_dn2 = 0;
};
PairStatistics StatisticsOfPair(const Image<uint16_t>& first_dn, const Image<uint16_t>& second_dn);

// One exposure of the photon transfer series: two bright images and two dark ones of the same
// exposure time.
struct ExposureStep {
  double photons = 0;  // mu_p, mean per pixel
  double exposure_time_s = 0;
  PairStatistics bright, dark;
};

struct PhotonTransfer {
  Estimate responsivity_dn_per_photon;     // R, from 0 to 70 % of saturation
  Estimate gain_dn_per_electron;           // K, likewise
  Estimate quantum_efficiency;             // R / K
  Estimate dark_noise_electrons;           // sigma_d, without quantisation noise
  bool dark_noise_is_upper_bound = false;  // quantisation hides it (variance below 0.24 DN^2)
  Estimate saturation_photons;             // mu_p.sat, by the largest variance
  Estimate saturation_capacity_electrons;  // mu_e.sat
  Estimate sensitivity_threshold_photons;  // mu_p.min, where SNR is 1
  double dynamic_range = 0;                // mu_p.sat / mu_p.min
  double largest_snr = 0;                  // sqrt(mu_e.sat)
  // Mean of |deviation| from the line of least relative squares, 5 to 95 % of saturation.
  double linearity_error_relative = 0;
  double linearity_error_min_relative = 0, linearity_error_max_relative = 0;
  // The part of its mean that temporal noise alone causes for a linear camera.
  double linearity_noise_relative = 0;
};

// Clauses 6.6 to 6.9. Steps ascend in photons and reach beyond saturation. INVALID_ARGUMENT: fewer
// than 20 steps, not ascending, no saturation among them.
absl::StatusOr<PhotonTransfer> MeasurePhotonTransfer(std::span<const ExposureStep> steps);

// Two dark images of one exposure time.
struct DarkStep {
  double exposure_time_s = 0;
  PairStatistics dark;
};

struct DarkCurrent {
  Estimate from_mean_electrons_per_s;
  Estimate from_variance_electrons_per_s;
  Estimate dark_mean_electrons;  // mu_d at exposure time 0 (with the black level)
};

// Clause 7.1: slopes over the exposure time. INVALID_ARGUMENT: fewer than three different times.
absl::StatusOr<DarkCurrent> MeasureDarkCurrent(std::span<const DarkStep> steps,
                                               const Estimate& gain_dn_per_electron);

struct TemperatureStep {
  double temperature_c = 0;
  Estimate dark_current_electrons_per_s;
};

struct DarkCurrentOverTemperature {
  Estimate doubling_k;
  Estimate at_reference_electrons_per_s;
};

// Clause 7.2: line through log2 of the dark currents, weighted by their errors. INVALID_ARGUMENT:
// fewer than three temperatures, or a dark current that is not above twice its standard error.
absl::StatusOr<DarkCurrentOverTemperature> MeasureDoublingTemperature(
    std::span<const TemperatureStep> steps, double reference_temperature_c);

// Sums of many frames under the same conditions (clause 8.1).
class FrameStack {
 public:
  // All frames have the same size.
  void Add(const Image<uint16_t>& frame_dn);

  int frames() const { return frames_; }
  double pixels() const { return static_cast<double>(sum_.size()); }
  double MeanDn() const;
  // Mean over the pixels of the temporal variance.
  double TemporalVarianceDn2() const;
  // Variance over the pixels of the averaged frame, including its residual temporal noise.
  double MeasuredSpatialVarianceDn2() const;

 private:
  int frames_ = 0;
  std::vector<uint64_t> sum_, sum_of_squares_;
};

struct NonUniformity {
  Estimate dsnu_electrons;  // DSNU1288
  Estimate prnu_relative;   // PRNU1288
};

// Clause 8.2, from stacks of dark frames and of frames at 50 % of saturation. The light has to be
// uniform: no high-pass filter is applied. A spatial variance below zero gives 0 with the standard
// error of the variance's root. INVALID_ARGUMENT: stacks of fewer than two frames, or of different
// size.
absl::StatusOr<NonUniformity> MeasureNonUniformity(const FrameStack& dark,
                                                   const FrameStack& half_saturated,
                                                   const Estimate& gain_dn_per_electron);

}  // namespace sightline
