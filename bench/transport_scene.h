// SPDX-License-Identifier: Apache-2.0
// The scene of thesis section 4.8 with the example cylinder head: laser line and room light.
#pragma once

#include <string>

#include "render_worker/light_transport/light_transport.h"

namespace sightline::bench {

struct TransportScene {
  SceneDescription scene;
  SceneView view;
  double pixel_pitch_m = 5.86e-6;
  int columns_px = 1920;
  int rows_px = 1200;

  // The whole sensor.
  SubPixelGrid Grid(int sub_pixels) const;
  // Part of it, from pixel (column, row) counted from the top left corner.
  SubPixelGrid Crop(int column, int row, int columns, int rows, int sub_pixels) const;
};

// `glb`: path of examples/cylinder_head/cylinder_head.glb. 16 mm lens at f/11, intake side and top
// of the head in view; the laser line runs through the intake ports; a lamp of 0.8 x 0.4 m and
// constant ambient. Ends the process on errors.
TransportScene CylinderHeadScene(const std::string& glb);

}  // namespace sightline::bench
