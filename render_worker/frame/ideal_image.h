// SPDX-License-Identifier: Apache-2.0
// Image by geometric optics on the sensor: the output of light transport and input of wave optics.
#pragma once

#include <array>
#include <vector>

#include "core/image/image.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

// Samples per pixel and axis, and the margin of the grid beyond the region of interest on every
// side. The centre of sample (i, j) is
//   u = (roi.column_px - margin_px + (j + 1/2) / sub_pixels - 1/2) p, v likewise.
struct SubPixelGrid {
  RegionOfInterest roi;
  int sub_pixels = 2;
  int margin_px = 0;
  double pixel_pitch_m = 0;

  int columns() const { return (roi.columns_px + 2 * margin_px) * sub_pixels; }
  int rows() const { return (roi.rows_px + 2 * margin_px) * sub_pixels; }
  double U(double j) const {
    return (roi.column_px - margin_px + (j + 0.5) / sub_pixels - 0.5) * pixel_pitch_m;
  }
  double V(double i) const {
    return (roi.row_px - margin_px + (i + 0.5) / sub_pixels - 0.5) * pixel_pitch_m;
  }
};

// Irradiance of the sensor plane at the sub-pixels by an aberration-free lens: with aperture,
// transmission and cos^4, before diffraction, defocus and speckle.
struct IdealImage {
  SubPixelGrid grid;
  Image<float> laser_irradiance_w_m2;
  // Object distance of every sub-pixel along the optical axis [m]; empty: constant_depth_m
  // everywhere. It determines the defocus of the laser light.
  Image<float> depth_m;
  double constant_depth_m = 0;

  // Other light on its own, coarser grid (same rule, own sub_pixels and margin), defocus included.
  SubPixelGrid incoherent_grid;
  // Photo-electrons per area and time [1/(m^2 s)] that each colour channel would release.
  std::array<Image<float>, 3> incoherent_electron_flux_m2_s;
  Image<float> incoherent_irradiance_w_m2;
  // Effective wavelength of each channel's light, for its optical transfer function.
  std::array<double, 3> incoherent_wavelength_m = {550e-9, 550e-9, 550e-9};
};

// Irradiance of the pixels: means over the pixels of the region of interest.
struct PixelIrradiance {
  RegionOfInterest roi;
  Image<float> laser_irradiance_w_m2;
  std::array<Image<float>, 3> incoherent_electron_flux_m2_s;  // empty: none
};

}  // namespace sightline
