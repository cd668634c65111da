// SPDX-License-Identifier: Apache-2.0
// A flat plate in any pose under any laser plane, computed exactly: every point of the plate has
// its own depth, distance from the laser, and directions of light and view.
#pragma once

#include <Eigen/Geometry>

#include "core/plate_line/plate_line.h"
#include "render_worker/frame/frame_setup.h"
#include "render_worker/plate/plate_scene.h"

namespace sightline {

// Laser with a uniform fan (power over 2 d tan(fan/2) at the distance d from its origin),
// reflectance, height and image mapping of the frame's plate, for RenderPlate. The camera's pixels
// are those of the whole sensor, whose middle is the frame's principal point. The frame's image
// distance must be the camera's focal length. `frame.plate.camera_distance_m`, the reference depth
// of heights, must be near the depth of the line. The rest of `frame.plate` is ignored.
// `sheet.origin_m` must be set.
PlateScene MakeTiltedPlateScene(const FrameSetup& frame, const TargetCamera& camera,
                                const LaserSheet& sheet, const PlateLine& line);

}  // namespace sightline
