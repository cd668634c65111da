// SPDX-License-Identifier: Apache-2.0
// Lenses, images and closed forms shared by the optics tests.
#pragma once

#include "render_worker/optics/image_optics.h"

namespace sightline::optics_test {

inline constexpr double kWavelength_m = 661e-9;
inline constexpr double kPitch_m = 5.3e-6;
inline constexpr double kImageDistance_m = 0.017;

// A clear circular pupil whose field has its cut-off at `cut_off` cycles per pixel; an object at
// depth z has the curvature 1/f - 1/z - 1/b, f chosen so that z = 0.3125 m is in focus.
OpticsModel ClearLens(double cut_off_per_px);
// Pupil radius of it.
double PupilRadius(double cut_off_per_px);
// Curvature of a depth as ClearLens has it.
double Curvature(double depth_m);
inline constexpr double kFocus_m = 0.3125;

// An image of even light, 1 W/m^2, in focus.
IdealImage EvenImage(int columns_px, int rows_px, int sub_pixels, int margin_px);

// |mu|^2 = (2 J1(v)/v)^2, v = 2 pi q_c x: squared coherence of a speckle field at distance x [px]
// (Goodman, Speckle Phenomena in Optics, eq. 4-65).
double SquaredCoherence(double cut_off_per_px, double distance_px);
// Correlation of the intensities of two pixels (dx, dy) apart, over the squared mean: |mu|^2
// averaged over both pixels (Goodman, eq. 4-141 for dx = dy = 0: squared contrast).
double PixelCorrelation(double cut_off_per_px, double dx_px, double dy_px);

struct Moments {
  double mean, contrast;
};
Moments MomentsOf(const Image<float>& image);

}  // namespace sightline::optics_test
