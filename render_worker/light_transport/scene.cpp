// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Width of a reflected ray per length, for height fields: light from all around blurs them.
constexpr float kReflectedGrowth = 0.05F;

absl::Status CheckDescription(const SceneDescription& description) {
  size_t triangles = 0;
  for (size_t m = 0; m < description.meshes.size(); ++m) {
    const SceneMesh& mesh = description.meshes[m];
    triangles += mesh.mesh.triangles.size();
    if (!mesh.triangle_material.empty() &&
        mesh.triangle_material.size() != mesh.mesh.triangles.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("mesh ", m, ": ", mesh.triangle_material.size(), " materials for ",
                       mesh.mesh.triangles.size(), " triangles"));
    }
    size_t largest = 0;
    for (const uint16_t material : mesh.triangle_material) {
      largest = std::max<size_t>(largest, material);
    }
    if (largest >= description.materials.size()) {
      return absl::InvalidArgumentError(absl::StrCat("mesh ", m, ": material index ", largest,
                                                     " outside [0, ", description.materials.size(),
                                                     ")"));
    }
    for (const auto& triangle : mesh.mesh.triangles) {
      for (const uint32_t corner : triangle) {
        if (corner >= mesh.mesh.positions_m.size()) {
          return absl::InvalidArgumentError(absl::StrCat("mesh ", m, ": vertex index ", corner,
                                                         " outside [0, ",
                                                         mesh.mesh.positions_m.size(), ")"));
        }
      }
    }
  }
  if (triangles == 0) return absl::InvalidArgumentError("scene: no triangles");
  for (size_t m = 0; m < description.materials.size(); ++m) {
    if (description.materials[m] == nullptr) {
      return absl::InvalidArgumentError(absl::StrCat("scene: material ", m, " is missing"));
    }
  }
  for (size_t l = 0; l < description.area_lights.size(); ++l) {
    const EmittingRectangle& light = description.area_lights[l];
    const double area = light.half_edge_u_m.cross(light.half_edge_v_m).norm();
    if (!(area > 0) || std::abs(light.half_edge_u_m.dot(light.half_edge_v_m)) > 1e-6 * area) {
      return absl::InvalidArgumentError(
          absl::StrCat("area light ", l, ": half edges must be perpendicular and not zero"));
    }
  }
  return absl::OkStatus();
}

void AttachTriangles(RTCDevice device, RTCScene scene, const Eigen::Vector3f* positions,
                     size_t position_count, const std::array<uint32_t, 3>* triangles,
                     size_t triangle_count) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<Eigen::Vector3f*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              sizeof(Eigen::Vector3f), position_count));
  void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                          3 * sizeof(uint32_t), triangle_count);
  if (vertices != nullptr && indices != nullptr) {
    std::copy(positions, positions + position_count, vertices);
    std::memcpy(indices, triangles, triangle_count * 3 * sizeof(uint32_t));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
  }
  rtcReleaseGeometry(geometry);
}

}  // namespace

absl::StatusOr<std::unique_ptr<RayScene>> RayScene::Make(SceneDescription description) {
  SIGHTLINE_RETURN_IF_ERROR(CheckDescription(description));
  std::unique_ptr<RayScene> scene(new RayScene(std::move(description)));
  const SceneDescription& d = scene->description_;
  scene->device_ = rtcNewDevice("threads=1");
  if (scene->device_ == nullptr) return absl::InternalError("Embree: no device");
  scene->scene_ = rtcNewScene(scene->device_);
  rtcSetSceneFlags(scene->scene_, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene->scene_, RTC_BUILD_QUALITY_HIGH);
  float largest = 0;
  for (const SceneMesh& mesh : d.meshes) {
    AttachTriangles(scene->device_, scene->scene_, mesh.mesh.positions_m.data(),
                    mesh.mesh.positions_m.size(), mesh.mesh.triangles.data(),
                    mesh.mesh.triangles.size());
    for (const auto& p : mesh.mesh.positions_m)
      largest = std::max(largest, p.cwiseAbs().maxCoeff());
  }
  for (const EmittingRectangle& light : d.area_lights) {
    const Eigen::Vector3d &c = light.centre_m, &u = light.half_edge_u_m, &v = light.half_edge_v_m;
    const Eigen::Vector3f corners[4] = {(c - u - v).cast<float>(), (c + u - v).cast<float>(),
                                        (c + u + v).cast<float>(), (c - u + v).cast<float>()};
    const std::array<uint32_t, 3> triangles[2] = {{0, 1, 2}, {0, 2, 3}};
    AttachTriangles(scene->device_, scene->scene_, corners, 4, triangles, 2);
  }
  rtcCommitScene(scene->scene_);
  if (const RTCError error = rtcGetDeviceError(scene->device_); error != RTC_ERROR_NONE) {
    if (error == RTC_ERROR_OUT_OF_MEMORY) {
      return absl::ResourceExhaustedError("Embree ran out of memory building the scene");
    }
    return absl::InternalError(absl::StrCat("Embree: error ", static_cast<int>(error)));
  }
  // Rounding of a hit position is some units in the last place of the largest coordinate.
  scene->lift_m_ = largest * 0x1p-18F;
  for (const auto& material : d.materials) scene->grey_ = scene->grey_ && material->grey();
  return scene;
}

RayScene::~RayScene() {
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  if (device_ != nullptr) rtcReleaseDevice(device_);
}

bool RayScene::Intersect(const Eigen::Vector3f& origin_m, const Eigen::Vector3f& direction,
                         float footprint_m, float footprint_growth, SurfacePoint& point) const {
  RTCRayHit query;
  query.ray.org_x = origin_m.x();
  query.ray.org_y = origin_m.y();
  query.ray.org_z = origin_m.z();
  query.ray.dir_x = direction.x();
  query.ray.dir_y = direction.y();
  query.ray.dir_z = direction.z();
  query.ray.tnear = 0;
  query.ray.tfar = std::numeric_limits<float>::infinity();
  query.ray.time = 0;
  query.ray.mask = static_cast<unsigned>(-1);
  query.ray.id = 0;
  query.ray.flags = 0;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene_, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;

  point.distance = query.ray.tfar;
  point.position_m = origin_m + query.ray.tfar * direction;
  Eigen::Vector3f normal(query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z);
  normal.normalize();
  point.front = normal.dot(direction) < 0;
  if (!point.front) normal = -normal;
  if (query.hit.geomID >= description_.meshes.size()) {
    point.lamp = static_cast<int>(query.hit.geomID - description_.meshes.size());
    point.material = nullptr;
    point.normal = normal;
    return true;
  }
  point.lamp = -1;
  const SceneMesh& mesh = description_.meshes[query.hit.geomID];
  point.material_index =
      mesh.triangle_material.empty() ? 0 : mesh.triangle_material[query.hit.primID];
  point.material = description_.materials[point.material_index].get();
  const Eigen::Matrix3f frame = LocalFrame(normal, point.material->machining_direction());
  point.tangent = frame.col(0);
  point.bitangent = frame.col(1);
  point.normal = normal;
  if (point.material->has_detail()) {
    point.detail = point.material->DetailAt(point.position_m, normal,
                                            footprint_m + footprint_growth * point.distance);
  } else {
    point.detail = SurfaceDetail();
  }
  return true;
}

bool RayScene::IntersectFrom(const SurfacePoint& from, const Eigen::Vector3f& direction,
                             SurfacePoint& point) const {
  return Intersect(from.position_m + lift_m_ * from.normal, direction, 0, kReflectedGrowth, point);
}

bool RayScene::Clear(const Eigen::Vector3f& from_m, const Eigen::Vector3f& to_m,
                     float t_far) const {
  const Eigen::Vector3f direction = to_m - from_m;
  RTCRay ray;
  ray.org_x = from_m.x();
  ray.org_y = from_m.y();
  ray.org_z = from_m.z();
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.tnear = 0;
  ray.tfar = t_far;
  ray.time = 0;
  ray.mask = static_cast<unsigned>(-1);
  ray.id = 0;
  ray.flags = 0;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene_, &context, &ray);
  return ray.tfar >= 0;
}

bool RayScene::Visible(const SurfacePoint& from, const Eigen::Vector3f& to_m) const {
  // Stops short of the end: it may lie on a lamp.
  return Clear(from.position_m + lift_m_ * from.normal, to_m, 1 - 1e-4F);
}

bool RayScene::Visible(const SurfacePoint& from, const SurfacePoint& to) const {
  return Clear(from.position_m + lift_m_ * from.normal, to.position_m + lift_m_ * to.normal, 1);
}

}  // namespace sightline
