// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/frame_light.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "proto/status/rpc_status.h"
#include "render_worker/light_transport/camera_rays.h"
#include "render_worker/render/part_view.h"
#include "tests/render_worker/optical_planning/step_scene.h"

namespace sightline {
namespace {

FrameLight Trace(PartScene& scene, const PartFrameRequest& request = StepFrame()) {
  FrameLightOptions options;
  options.limits = TwoThreads();
  auto light = TraceFrameLight(scene, request, {}, options);
  EXPECT_TRUE(light.ok()) << light.status();
  return *std::move(light);
}

// Every crossing is where the ray of its pixel meets the laser sheet on one of the two plates.
TEST(FrameLight, TrueLineIsWhereSheetAndSurfaceMeet) {
  const auto scene = StepScene();
  const PartFrameRequest request = StepFrame(0.001);
  const FrameLight light = Trace(*scene, request);
  const FrameSetup frame = PartFrameSetup(scene->inspection(), request);
  const TrueGeometry truth{scene->inspection().rig, request.measurement};
  const SceneView view = MakeView(*scene, truth, frame, request.stage_position_m);
  const CameraRays camera(view);
  // One crossing per column, but for those of the step.
  std::map<int, int> per_column;
  for (const LineCrossing& crossing : light.line) ++per_column[crossing.column_px];
  EXPECT_GT(per_column.size(), 170U);
  ASSERT_EQ(light.line_views.size(), light.line.size());
  for (size_t i = 0; i < light.line.size(); ++i) {
    const LineCrossing& crossing = light.line[i];
    const double u = (frame.roi.column_px + crossing.column_px) * frame.sensor.pixel_pitch_m;
    const double v = (frame.roi.row_px + crossing.row_px) * frame.sensor.pixel_pitch_m;
    const Eigen::Vector3d direction = camera.ChiefDirection(u, v);
    // On the sheet ...
    const Eigen::Vector3d& n = view.laser.y_axis;
    const double depth = n.dot(view.laser.origin_m - camera.origin_m()) / n.dot(direction);
    const Eigen::Vector3d point = camera.origin_m() + depth * direction;
    // ... and on the plate of its side. A hundredth of a pixel is 1 um here.
    const double plate = point.y() > 0 ? 0.004 : 0.0;
    if (std::abs(point.y()) > 0.0002) {
      EXPECT_NEAR(point.z(), plate, 3e-6) << crossing.column_px;
      // Seen from the camera; the plates face along z.
      const Eigen::Vector3d to_camera = camera.origin_m() - point;
      EXPECT_NEAR(light.line_views[i].distance_m, to_camera.norm(), 2e-5) << crossing.column_px;
      EXPECT_NEAR(light.line_views[i].incidence_rad, std::acos(to_camera.z() / to_camera.norm()),
                  0.01)
          << crossing.column_px;
    }
  }
  // The sheet in camera coordinates.
  EXPECT_NEAR(light.sheet_normal.norm(), 1, 1e-12);
  // The part's middle is at 0.3 m.
  EXPECT_NEAR(light.median_line_depth_m, 0.3, 0.0021);
}

// Light without a lens is what the renderer finds: twice the power is twice the light.
TEST(FrameLight, RadianceFollowsThePower) {
  const auto scene = StepScene();
  const auto strong = StepScene();
  PartFrameRequest request = StepFrame();
  const FrameLight one = Trace(*scene, request);
  request.setting = CameraSetting{4, 0.0005, 0.3, 0.01, 0, 0};
  const FrameLight two = Trace(*scene, request);
  EXPECT_NEAR(two.median_line_radiance_w_m2_sr / one.median_line_radiance_w_m2_sr, 2, 1e-3);
  EXPECT_EQ(two.laser_power_w, 0.01);
}

TEST(FrameLight, NoLineSaysSo) {
  const auto scene = StepScene();
  FrameLightOptions options;
  // The part has gone by.
  const auto light = TraceFrameLight(*scene, StepFrame(0.5), {}, options);
  ASSERT_FALSE(light.ok());
  EXPECT_EQ(light.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ErrorReason(light.status()), "NO_LINE");
}

TEST(FrameLight, CancelledStops) {
  const auto scene = StepScene();
  FrameLightOptions options;
  const std::atomic<bool> cancelled = true;
  options.limits.cancelled = &cancelled;
  EXPECT_EQ(TraceFrameLight(*scene, StepFrame(), {}, options).status().code(),
            absl::StatusCode::kCancelled);
}

// The coarse look finds the line where the fine one does.
TEST(FrameGlance, SeesTheLinesRows) {
  const auto scene = StepScene();
  const auto glance = GlanceAtFrame(*scene, StepFrame(), {}, 8, TwoThreads());
  ASSERT_TRUE(glance.ok()) << glance.status();
  const FrameLight light = Trace(*scene);
  EXPECT_GT(glance->lit_samples, 10);
  EXPECT_NEAR(glance->mean_depth_m, light.median_line_depth_m, 0.004);
  for (const LineCrossing& crossing : light.line) {
    const double row = light.grid.roi.row_px + crossing.row_px;
    EXPECT_GE(row, glance->roi.row_px);
    EXPECT_LT(row, glance->roi.row_px + glance->roi.rows_px);
  }
  const auto dark = GlanceAtFrame(*scene, StepFrame(0.5), {}, 8, TwoThreads());
  ASSERT_TRUE(dark.ok());
  EXPECT_EQ(dark->lit_samples, 0);
}

}  // namespace
}  // namespace sightline
