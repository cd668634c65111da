// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/camera_rays.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/rig/scheimpflug.h"
#include "tests/render_worker/light_transport/test_scenes.h"

namespace sightline {
namespace {

TEST(CameraRays, ChiefRayMeetsTheMagnifiedSensorPosition) {
  SceneView view;
  view.camera = LookDown({0.01, -0.02, 0.3});
  view.image_distance_m = 0.017;
  const Eigen::Vector3d d = CameraRays(view).ChiefDirection(1e-3, -2e-3);
  const Eigen::Vector3d p = view.camera.origin_m + 0.3 * d;
  EXPECT_NEAR(p.x(), 0.01 + 0.3 / 0.017 * 1e-3, 1e-12);
  EXPECT_NEAR(p.y(), -0.02 + 0.3 / 0.017 * 2e-3, 1e-12);  // rows grow downwards
  EXPECT_NEAR(p.z(), 0, 1e-12);
}

TEST(CameraRays, UndistortInvertsBrownConrady) {
  const Distortion d{-0.12, 0.05, 0.01, 1e-3, -2e-3};
  for (const double x : {-0.3, 0.0, 0.25}) {
    for (const double y : {-0.2, 0.1}) {
      const double r2 = x * x + y * y;
      const double radial = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
      const Eigen::Vector2d distorted(x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x),
                                      y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y);
      EXPECT_LT((Undistort(d, distorted) - Eigen::Vector2d(x, y)).norm(), 1e-14);
    }
  }
}

TEST(CameraRays, RaysThroughThePupilMeetInTheFocusedPlane) {
  SceneView view;
  view.camera = LookDown({0, 0, 0.3});
  view.image_distance_m = 0.017;
  view.focus_distance_m = 0.25;
  view.pupil_radius_m = 4e-3;
  const CameraRays camera(view);
  const Eigen::Vector3f focus =
      (view.camera.origin_m + 0.25 * camera.ChiefDirection(1e-3, 2e-3)).cast<float>();
  double r2 = 0;
  const int n = 64;
  for (int k = 0; k < n * n; ++k) {
    const int row = k / n, column = k % n;
    const CameraRays::Ray ray = camera.PupilRay(1e-3, 2e-3, (row + 0.5F) / n, (column + 0.5F) / n);
    EXPECT_LT((ray.origin_m + ray.direction - focus).norm(), 1e-7F);
    r2 += (ray.origin_m.cast<double>() - view.camera.origin_m).squaredNorm();
  }
  // Second moment of an even disc: R^2/2.
  EXPECT_NEAR(r2 / (n * n), 4e-3 * 4e-3 / 2, 1e-9);
}

// A sensor tilted to an object plane by Scheimpflug's rule: the rays of every place meet on that
// plane.
TEST(CameraRays, TiltedSensorsFocusOnATiltedPlane) {
  SceneView view;
  view.camera = LookDown({0, 0, 0.3});
  view.pupil_radius_m = 5e-3;
  constexpr double kFocalLength_m = 0.016;
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, 0.6, 0.7).normalized();
  const double offset_m = 0.28 * normal.z();
  const auto plane = ScheimpflugPlane(normal, offset_m, kFocalLength_m);
  ASSERT_TRUE(plane.has_value());
  view.image_distance_m = plane->image_distance_m;
  view.focus_distance_m = 0.28;
  view.sensor_slope_u = plane->slope_u;
  view.sensor_slope_v = plane->slope_v;
  const CameraRays camera(view);
  for (const double u : {-2e-3, 0.0, 2e-3}) {
    for (const double v : {-2e-3, 0.0, 2e-3}) {
      for (const float pupil : {0.1F, 0.5F, 0.9F}) {
        const CameraRays::Ray ray = camera.PupilRay(u, v, pupil, pupil);
        const Eigen::Vector3d met =
            (ray.origin_m + ray.direction).cast<double>() - view.camera.origin_m;
        const Eigen::Vector3d in_camera(met.dot(view.camera.x_axis), met.dot(view.camera.y_axis),
                                        met.dot(view.camera.z_axis));
        EXPECT_NEAR(normal.dot(in_camera), offset_m, 2e-7) << u << " " << v;
      }
    }
  }
}

}  // namespace
}  // namespace sightline
