// SPDX-License-Identifier: Apache-2.0
// From the ideal image to the irradiance of the pixels: diffraction, defocus, speckle, pixels.
#pragma once

#include <complex>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/frame/frame_setup.h"
#include "render_worker/frame/ideal_image.h"
#include "render_worker/optics/pupil.h"

namespace sightline {

// Factor of the irradiance's spectrum on the sensor at frequency (qx, qy) [1/m]: halo, motion.
using TransferFunction = std::function<std::complex<double>(double qx_per_m, double qy_per_m)>;

// Pupil seen from a point (u, v) of the sensor; it changes slowly over the field.
using PupilAtField = std::function<Pupil(double u_m, double v_m)>;

// Wavefront curvature 1/b' - 1/b of an object point at depth z seen at (u, v).
using CurvatureAtField = std::function<double(double depth_m, double u_m, double v_m)>;

struct OpticsModel {
  PupilAtField pupil;
  CurvatureAtField curvature;
  double image_distance_m = 0;
  double wavelength_m = 0;
  double reference_pupil_radius_m = 0;  // radius the ideal irradiance was computed for
  std::vector<TransferFunction> transfer;
  bool field_dependent = false;   // pupil or curvature vary over the field
  bool curvature_varies = false;  // only the curvature varies over the field
  // Depths whose wavefronts differ by less than this at the pupil's rim share a layer
  // [wavelengths].
  double layer_step_waves = 0.125;
};

struct SpeckleModel {
  uint64_t seed = 0;
  std::vector<double> pattern_weights = {1};  // independent patterns, sum 1
  bool on = true;
  // Shift of the scatterers in the image during the exposure [m]. With several entries, the
  // exposure is the mean of these moments.
  struct Shift {
    double u_m = 0, v_m = 0;
  };
  std::vector<Shift> shifts = {{0, 0}};
};

// Margin [px] beyond which the point spread of pupil, defocus (either sign) and transfer functions
// holds less than the share `lost_energy`. Diffraction at a hard rim only falls with 1/r: 203
// lambda N' for a thousandth, 20 lambda N' for a hundredth (asymptote of Rayleigh's 1 - J0^2 -
// J1^2). Pupils that vary over the field are evaluated within field_radius_m of the axis. At most
// 1024.
int RequiredMargin(const OpticsModel& optics, double largest_curvature_per_m, double pixel_pitch_m,
                   double field_radius_m = 0, double lost_energy = 1e-3);

// Coherent laser light (thesis eq. 4.15-4.25): a circular Gaussian field of irradiance
// image.laser_irradiance_w_m2 is filtered by the generalised pupil of each depth; the fields of all
// depths are summed, squared, and integrated exactly over the pixels (sinc in frequency). Depth is
// divided so finely that the wavefront error at the pupil's rim differs by less than
// layer_step_waves between layers. The scatterers depend only on the sub-pixel's absolute position
// and the seed, so blocks, other regions and moved patterns share them. The result depends on the
// division into blocks only through the truncated point spread (a thousandth of the light, some per
// cent of the irradiance in a speckle). A field-dependent pupil is constant over blocks of 96 px,
// or half the reach of the point spread if that is more; its vignetting varies smoothly. There is
// no wrap-around for any margin of the grid. Dark regions take no time. Without speckle: the mean
// over all patterns. Incoherent light: optical transfer function of each channel's pupil at the
// region's centre, then the mean of each pixel's samples, which are means over their sub-pixels.
// The grid must be fine enough for the pupil (RequiredSubPixels). The bytes do not depend on the
// number of threads.
PixelIrradiance ApplyOptics(const IdealImage& image, const OpticsModel& optics,
                            const SpeckleModel& speckle, int threads);

}  // namespace sightline
