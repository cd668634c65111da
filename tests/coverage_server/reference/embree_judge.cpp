// SPDX-License-Identifier: Apache-2.0
#include "tests/coverage_server/reference/embree_judge.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <limits>

namespace sightline {
namespace {

RTCRay MakeRay(const Eigen::Vector3d& from, const Eigen::Vector3d& direction, double near_m,
               double far_m) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(from.x());
  ray.org_y = static_cast<float>(from.y());
  ray.org_z = static_cast<float>(from.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = static_cast<float>(near_m);
  ray.tfar = static_cast<float>(far_m);
  ray.mask = static_cast<unsigned>(-1);
  return ray;
}

}  // namespace

EmbreeJudge::EmbreeJudge(const TriangleMesh& mesh) : mesh_(mesh) {
  device_ = rtcNewDevice("threads=1");
  scene_ = rtcNewScene(device_);
  rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, mesh.positions_m.size()));
  for (const auto& p : mesh.positions_m) {
    for (int k = 0; k < 3; ++k) *vertices++ = p[k];
  }
  auto* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12,
                                          mesh.triangles.size());
  std::memcpy(indices, mesh.triangles.data(), 12 * mesh.triangles.size());
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_);
}

EmbreeJudge::~EmbreeJudge() {
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

bool EmbreeJudge::Occluded(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                           double gap_m) const {
  const double length = (to - from).norm();
  RTCRay ray = MakeRay(from, (to - from) / length, 0, length - gap_m);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene_, &context, &ray);
  return ray.tfar < 0;
}

bool EmbreeJudge::Hidden(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                         double gap_m) const {
  RTCRay ray = MakeRay(from, direction, gap_m, std::numeric_limits<float>::infinity());
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene_, &context, &ray);
  return ray.tfar < 0;
}

std::vector<EmbreeJudge::Hit> EmbreeJudge::Crossings(const Eigen::Vector3d& point,
                                                     const Eigen::Vector3d& direction,
                                                     double reach_m) const {
  constexpr double kStepM = 1e-6;
  const Eigen::Vector3d d = direction.normalized();
  const Eigen::Vector3d from = point - reach_m * d;
  std::vector<Hit> hits;
  double near_m = 0;
  while (hits.size() < 1000) {
    RTCRayHit query{};
    query.ray = MakeRay(from, d, near_m, 2 * reach_m);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene_, &context, &query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) break;
    // Embree's distance is a float; the barycentric coordinates place the hit on the triangle.
    const uint32_t t = query.hit.primID;
    const double u = query.hit.u, v = query.hit.v;
    hits.push_back(
        {(1 - u - v) * mesh_.Corner(t, 0) + u * mesh_.Corner(t, 1) + v * mesh_.Corner(t, 2), t});
    near_m = query.ray.tfar + kStepM;
  }
  return hits;
}

std::vector<JudgePoint> EmbreeJudge::Frame(const Rig& rig, const Measurement& m, int frame) const {
  constexpr double kGapM = 2e-5;
  const auto stand = [&](double distance, double polar) -> Eigen::Vector3d {
    return distance * Eigen::Vector3d(std::sin(polar) * std::cos(m.camera_azimuth_rad),
                                      std::sin(polar) * std::sin(m.camera_azimuth_rad),
                                      std::cos(polar));
  };
  const Eigen::Vector3d camera = stand(m.camera_distance_m, m.camera_polar_rad);
  const Eigen::Vector3d laser = stand(rig.laser.distance_m.value_or(m.camera_distance_m),
                                      m.camera_polar_rad - m.triangulation_angle_rad);
  const Eigen::Vector3d e(-std::sin(m.camera_azimuth_rad), std::cos(m.camera_azimuth_rad), 0);
  const Eigen::Vector3d axis = -camera.normalized(), down = axis.cross(e);
  const Eigen::Vector3d sheet = laser.cross(e).normalized();
  const double focal = 0.5 * rig.camera.rows_px / std::tan(0.5 * rig.camera.vertical_fov_rad);

  const Eigen::Matrix3d rotation = (Eigen::AngleAxisd(m.part_gamma_rad, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(m.part_beta_rad, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(m.part_alpha_rad, Eigen::Vector3d::UnitX()))
                                       .toRotationMatrix();
  const Eigen::Vector3d shift(frame * rig.scan_step_m, m.offset_y_m, m.offset_z_m);
  const Eigen::Vector3d centre = mesh_.BoundingBox().center();
  const double reach = 0.55 * mesh_.BoundingBox().sizes().norm() + 1e-3;
  const auto to_part = [&](const Eigen::Vector3d& x) -> Eigen::Vector3d {
    return rotation.transpose() * (x - shift) + centre;
  };
  const Eigen::Vector3d camera_in_part = to_part(camera), laser_in_part = to_part(laser);

  std::vector<JudgePoint> points;
  for (int column = 0; column < rig.camera.columns_px; ++column) {
    const double offset = (column + 0.5 - 0.5 * rig.camera.columns_px) / focal;
    // The column's plane holds the camera, its `down` axis and the ray through the column.
    const Eigen::Vector3d plane = (e - offset * axis).normalized();
    const Eigen::Vector3d along = sheet.cross(plane).normalized();
    // The point of both planes nearest to the part.
    Eigen::Matrix3d rows;
    rows << sheet.transpose(), plane.transpose(), along.transpose();
    const Eigen::Vector3d point =
        rows.fullPivLu().solve(Eigen::Vector3d(0, plane.dot(camera), along.dot(shift)));
    if ((point - shift).norm() > reach) continue;
    for (const Hit& hit : Crossings(to_part(point), rotation.transpose() * along, reach)) {
      const Eigen::Vector3d normal = mesh_.Normal(hit.triangle);
      if (normal.dot(camera_in_part - hit.position_m) <= 0) continue;
      if (normal.dot(laser_in_part - hit.position_m) <= 0) continue;
      const Eigen::Vector3d x = rotation * (hit.position_m - centre) + shift;
      const double depth = (x - camera).dot(axis);
      if (depth <= 1e-3 ||
          std::abs((x - camera).dot(down)) > depth * 0.5 * rig.camera.rows_px / focal)
        continue;
      if ((x - camera).norm() > rig.max_range_m) continue;
      const double laser_depth = -(x - laser).dot(laser.normalized());
      if (laser_depth <= 0 ||
          std::abs((x - laser).dot(e)) > laser_depth * std::tan(0.5 * rig.laser.fan_angle_rad)) {
        continue;
      }
      if (Occluded(laser_in_part, hit.position_m, kGapM)) continue;
      if (Occluded(camera_in_part, hit.position_m, kGapM)) continue;
      points.push_back({hit.position_m, normal, frame, column});
    }
  }
  return points;
}

}  // namespace sightline
