// SPDX-License-Identifier: Apache-2.0
// A flat plate in any pose under a laser plane in any position, exactly: every point of the plate
// has its own depth, distance from the laser, and directions of light and view.
#pragma once

#include <Eigen/Geometry>

#include "core/plate_line/plate_line.h"
#include "render_worker/frame/frame_setup.h"
#include "render_worker/plate/plate_scene.h"

namespace sightline {

// Laser of an even fan (power over 2 d tan(fan/2) at the distance d from its origin), reflectance,
// height and image mapping of the frame's plate; to be rendered by RenderPlate. The camera's pixels
// are those of the whole sensor, whose middle is where the frame has its principal point. The
// frame's image distance must be the camera's focal length; `frame.plate.camera_distance_m`, the
// depth that heights refer to, must be near the depth of the line. The rest of `frame.plate` is not
// read. `sheet.origin_m` must be set.
PlateScene MakeTiltedPlateScene(const FrameSetup& frame, const TargetCamera& camera,
                                const LaserSheet& sheet, const PlateLine& line);

}  // namespace sightline
