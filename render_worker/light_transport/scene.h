// SPDX-License-Identifier: Apache-2.0
// Surfaces and lamps of a scene, for ray casting with Embree.
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/light_transport/light_transport.h"

namespace sightline {

// A point on a surface that a ray has met.
struct SurfacePoint {
  Eigen::Vector3f position_m = Eigen::Vector3f::Zero();
  float distance = 0;  // in lengths of the ray's direction
  // Columns of LocalFrame (material.h). The normal is that of the triangle on the side of the
  // ray.
  Eigen::Vector3f tangent = Eigen::Vector3f::UnitX();
  Eigen::Vector3f bitangent = Eigen::Vector3f::UnitY();
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  const Material* material = nullptr;  // null: a lamp
  uint16_t material_index = 0;
  int lamp = -1;
  bool front = true;  // met from the outer side
  SurfaceDetail detail;

  Eigen::Vector3f ToLocal(const Eigen::Vector3f& v) const {
    return {tangent.dot(v), bitangent.dot(v), normal.dot(v)};
  }
  Eigen::Vector3f ToWorld(const Eigen::Vector3f& v) const {
    return tangent * v.x() + bitangent * v.y() + normal * v.z();
  }
};

// Immutable after Make, hence thread-safe.
class RayScene {
 public:
  // Errors as LightTransport::Make.
  static absl::StatusOr<std::unique_ptr<RayScene>> Make(SceneDescription description);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  const SceneDescription& description() const { return description_; }
  bool grey() const { return grey_; }
  // Offset of ray origins from a surface, so that rounding causes no self-intersection.
  float lift_m() const { return lift_m_; }

  // Nearest surface along the ray; direction of any length. For height fields, `footprint_m` is the
  // width of the ray at the origin, and `footprint_growth` its growth per length of the direction.
  bool Intersect(const Eigen::Vector3f& origin_m, const Eigen::Vector3f& direction,
                 float footprint_m, float footprint_growth, SurfacePoint& point) const;
  // The same from a surface point, with the origin offset to the side of the direction.
  bool IntersectFrom(const SurfacePoint& from, const Eigen::Vector3f& direction,
                     SurfacePoint& point) const;

  // True if nothing is between the surface point and a point in space.
  bool Visible(const SurfacePoint& from, const Eigen::Vector3f& to_m) const;
  // The same between two surface points, both offset towards each other.
  bool Visible(const SurfacePoint& from, const SurfacePoint& to) const;

  RTCScene embree_scene() const { return scene_; }

 private:
  explicit RayScene(SceneDescription description) : description_(std::move(description)) {}
  bool Clear(const Eigen::Vector3f& from_m, const Eigen::Vector3f& to_m, float t_far) const;

  SceneDescription description_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  bool grey_ = true;
  float lift_m_ = 0;
};

}  // namespace sightline
