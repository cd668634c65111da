// SPDX-License-Identifier: Apache-2.0
// EMVA 1288 linear camera model, from irradiance to raw values (EMVA 1288 R4.0, section 2; thesis
// eq. 4.26-4.29 with electrons sampled from Poisson(eta mu_p)).
#pragma once

#include <cstdint>

#include "core/image/image.h"
#include "core/sensor/sensor.h"
#include "render_worker/frame/frame_setup.h"
#include "render_worker/frame/ideal_image.h"
#include "render_worker/sensor/pixel_planes.h"

namespace sightline {

// Mean photo-electrons of every pixel, eta(channel) E p^2 t lambda / (h c) for the laser plus the
// flux of other light (thesis eq. 4.27). All zero if the shutter is closed; no laser light if the
// laser is off. Pixels with irradiance slightly below 0 due to rounding get 0. `plane`: only its
// pixels are computed, the others are 0; nullptr: all.
Image<double> MeanPhotoElectrons(const PixelIrradiance& light, const FrameSetup& frame,
                                 const PixelPlane* plane = nullptr);

// Mean raw value of a dark pixel at exposure time 0: black level and mu_d (EMVA 1288 R4.0, section
// 2.3) [DN].
double DarkMeanDn(const Sensor& sensor);

// Mean dark charge of the exposure, mu_I t 2^((T - T_ref) / T_d) (EMVA 1288 R4.0, section 2.4 and
// 3), without mu_d.
double DarkCurrentElectrons(const FrameSetup& frame);

// Charge before conversion: Poisson photo-electrons (with the pixels' sensitivity, PRNU) and dark
// current (temperature doubling), normal dark noise, dark mean, fixed offsets (DSNU); limited to
// [0, N_sat]. `mean_photo_electrons` covers frame.roi. Random numbers only depend on the frame's
// seeds (noise: this frame; camera: fixed pattern) and the pixel's position on the sensor, so a
// smaller region of the same frame has the same pixels. `plane`: as above; its pixels are the same
// as without it.
Image<double> CollectElectrons(const Image<double>& mean_photo_electrons, const FrameSetup& frame,
                               const PixelPlane* plane = nullptr);

// min(max(round(K e + black level), 0), 2^bits - 1).
Image<uint16_t> Digitise(const Image<double>& electrons, const Sensor& sensor);

}  // namespace sightline
