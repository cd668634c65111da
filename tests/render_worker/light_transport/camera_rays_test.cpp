#include "render_worker/light_transport/camera_rays.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

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
    const CameraRays::Ray ray = camera.PupilRay(1e-3, 2e-3, (k / n + 0.5F) / n, (k % n + 0.5F) / n);
    EXPECT_LT((ray.origin_m + ray.direction - focus).norm(), 1e-7F);
    r2 += (ray.origin_m.cast<double>() - view.camera.origin_m).squaredNorm();
  }
  // Second moment of an even disc: R^2/2.
  EXPECT_NEAR(r2 / (n * n), 4e-3 * 4e-3 / 2, 1e-9);
}

}  // namespace
}  // namespace sightline
