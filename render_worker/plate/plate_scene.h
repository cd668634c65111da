// SPDX-License-Identifier: Apache-2.0
// The flat plate of the recordings format (docs/recordings.md), as functions of the position on it.
#pragma once

#include <array>
#include <functional>

#include "render_worker/frame/frame_setup.h"
#include "render_worker/frame/ideal_image.h"

namespace sightline {

// Function of the position on the plate (X along the line, s across it) [m].
using PlateFunction = std::function<double(double x_m, double s_m)>;
// Image point (u, v) at which an error-free lens would image the object point of a sensor point.
struct SensorPoint {
  double u_m, v_m;
};
using ImageMapping = std::function<SensorPoint(SensorPoint)>;

// Effects wrap these functions. An empty function has the null meaning.
struct PlateScene {
  PlateFunction laser_irradiance_w_m2;
  PlateFunction brdf_per_sr;               // laser direction to camera
  PlateFunction height_m;                  // towards the camera; empty: 0
  PlateFunction ambient_radiance_w_m2_sr;  // as photons of the laser's wavelength; empty: 0
  // Factor on the quantum efficiency of the channels, since other light may have other wavelengths.
  std::array<double, 3> ambient_channel_factor = {1, 1, 1};
  ImageMapping image_mapping;  // empty: identity
  // Irradiance is constant along X (as in the null model), so one column represents all.
  bool constant_along_line = true;
};

// Half width w at 1/e^2 of a beam of quality m2 at `distance_m` from the projector (eq. 5.2 with
// w0 = m2 lambda / (pi delta); the far-field angle stays delta).
double BeamRadius(const Laser& laser, double distance_m);
// Largest irradiance of a surface perpendicular to the beam, 2 P / (sqrt(2 pi) w L) (eq. 5.4), L =
// 2 d tan(fan/2).
double PeakIrradiance(const Laser& laser, double distance_m);
// Lambert + GGX/Schlick/Smith for incidence theta and the view along the normal (recordings format,
// section 3).
double PlateBrdf(const PlateSurface& surface, double incidence_angle_rad);

// The null model's plate.
PlateScene MakePlateScene(const FrameSetup& frame);

// E_ideal(u, v) = pi/4 L(v/m) T (D/b)^2 cos^4(phi) on the grid; ambient light likewise as electron
// flux. m = b / (d_c - height). Depth is set only at points with laser light. The bytes do not
// depend on the number of threads.
IdealImage RenderPlate(const PlateScene& scene, const FrameSetup& frame, const SubPixelGrid& grid,
                       int threads = 1);

}  // namespace sightline
