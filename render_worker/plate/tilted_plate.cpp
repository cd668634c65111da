// SPDX-License-Identifier: Apache-2.0
#include "render_worker/plate/tilted_plate.h"

#include <algorithm>
#include <cmath>

namespace sightline {

PlateScene MakeTiltedPlateScene(const FrameSetup& frame, const TargetCamera& camera,
                                const LaserSheet& sheet, const PlateLine& line) {
  const double reference_m = frame.plate.camera_distance_m;
  const double offset_m = line.normal.dot(line.point_m);
  const Eigen::Vector3d normal = line.normal, origin = *sheet.origin_m;
  // RenderPlate has x and s as camera coordinates x and y at the depth of the point.
  const auto point_at = [=](double x_m, double s_m) {
    return Eigen::Vector3d(x_m, s_m, (offset_m - normal.x() * x_m - normal.y() * s_m) / normal.z());
  };
  PlateScene scene;
  scene.constant_along_line = false;
  scene.height_m = [=](double x_m, double s_m) { return reference_m - point_at(x_m, s_m).z(); };
  scene.laser_irradiance_w_m2 = [=, laser = frame.laser](double x_m, double s_m) {
    const Eigen::Vector3d point = point_at(x_m, s_m);
    const Eigen::Vector3d to_laser = origin - point;
    const double distance_m = to_laser.norm();
    const double x = (sheet.normal.dot(point) - sheet.offset_m) / BeamRadius(laser, distance_m);
    if (x * x > 350) return 0.0;
    return PeakIrradiance(laser, distance_m) * std::exp(-2 * x * x) *
           std::max(0.0, to_laser.dot(normal) / distance_m);
  };
  scene.brdf_per_sr = [=, surface = frame.surface](double x_m, double s_m) {
    const Eigen::Vector3d point = point_at(x_m, s_m);
    const Eigen::Vector3d to_laser = (origin - point).normalized();
    const Eigen::Vector3d to_camera = -point.normalized();
    const Eigen::Vector3d half = (to_laser + to_camera).normalized();
    ObliqueView view;
    view.incidence_angle_rad = std::acos(std::clamp(to_laser.dot(normal), 1e-3, 1.0));
    view.view_cosine = std::clamp(to_camera.dot(normal), 1e-3, 1.0);
    view.half_normal_cosine = half.dot(normal);
    view.half_ray_cosine = half.dot(to_camera);
    return ObliqueBrdf(surface.diffuse_albedo, surface.specular_f0, surface.ggx_alpha, view);
  };
  const double pitch = frame.sensor.pixel_pitch_m, image_m = frame.ImageDistance();
  const Eigen::Vector2d middle(frame.sensor.columns_px / 2, frame.sensor.rows_px / 2);
  scene.image_mapping = [=](SensorPoint seen) {
    const Eigen::Vector3d ray = camera.Ray(middle + Eigen::Vector2d(seen.u_m, seen.v_m) / pitch);
    return SensorPoint{image_m * ray.x(), image_m * ray.y()};
  };
  return scene;
}

}  // namespace sightline
