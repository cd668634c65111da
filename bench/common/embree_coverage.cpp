// SPDX-License-Identifier: Apache-2.0
#include "bench/common/embree_coverage.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "bench/common/measure.h"

namespace sightline::bench {
namespace {

// Rays start this far above the surface and end this far before the sensor.
constexpr float kLiftM = 5e-5f;

}  // namespace

EmbreeMesh::EmbreeMesh(const TriangleMesh& mesh, int threads) {
  device_ = rtcNewDevice(("threads=" + std::to_string(threads)).c_str());
  if (device_ == nullptr) Fail("embree", "no device");
  scene_ = rtcNewScene(device_);
  rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<Eigen::Vector3f*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              sizeof(Eigen::Vector3f), mesh.positions_m.size()));
  std::copy(mesh.positions_m.begin(), mesh.positions_m.end(), vertices);
  void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                          3 * sizeof(uint32_t), mesh.triangles.size());
  std::memcpy(indices, mesh.triangles.data(), mesh.triangles.size() * 3 * sizeof(uint32_t));
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_);
  if (const RTCError error = rtcGetDeviceError(device_); error != RTC_ERROR_NONE) {
    Fail("embree", "error " + std::to_string(error));
  }
}

EmbreeMesh::~EmbreeMesh() {
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

TargetBits EmbreeCoverage::Covered(const ScanInPart& scan, int probes) const {
  TargetBits covered(targets_.size());
  if (!scan.sweeps) return covered;
  const Eigen::Vector3f camera = scan.camera.origin_m.cast<float>();
  const Eigen::Vector3f laser = scan.laser.origin_m.cast<float>();
  const Eigen::Vector3f x_axis = scan.camera.x_axis.cast<float>();
  const Eigen::Vector3f y_axis = scan.camera.y_axis.cast<float>();
  const Eigen::Vector3f z_axis = scan.camera.z_axis.cast<float>();
  const Eigen::Vector3f laser_z = scan.laser.z_axis.cast<float>();
  const Eigen::Vector3f direction = scan.scan_direction.cast<float>();
  const Eigen::Vector3f gradient = scan.lit_gradient.cast<float>();
  const auto offset = static_cast<float>(scan.lit_offset_m);
  const auto tan_x = static_cast<float>(scan.half_columns_px / scan.focal_length_px);
  const auto tan_y = static_cast<float>(scan.half_rows_px / scan.focal_length_px);
  const auto fan = static_cast<float>(scan.fan_tangent);
  const auto range = static_cast<float>(scan.max_range_m);

  // Eight targets that passed the cheap tests.
  constexpr int kLanes = 8;
  uint32_t target[kLanes];
  Eigen::Vector3f to_camera[kLanes], to_laser[kLanes];  // sensors at the lit moment
  int lanes = 0;
  const auto cast = [&] {
    int pending[kLanes];
    for (int i = 0; i < kLanes; ++i) pending[i] = i < lanes ? -1 : 0;
    for (int k = 0; k < probes; ++k) {
      alignas(32) int active[kLanes];
      alignas(32) RTCRay8 rays;
      const auto aim = [&](const Eigen::Vector3f* sensor) {
        bool any = false;
        for (int i = 0; i < kLanes; ++i) {
          if (active[i] == 0) continue;
          any = true;
          const size_t probe = size_t{target[i]} * kProbesPerTarget + k;
          const Eigen::Vector3f p = probes_.positions_m[probe] + kLiftM * probes_.normals[probe];
          const Eigen::Vector3f d = sensor[i] - p;
          rays.org_x[i] = p.x(), rays.org_y[i] = p.y(), rays.org_z[i] = p.z();
          rays.dir_x[i] = d.x(), rays.dir_y[i] = d.y(), rays.dir_z[i] = d.z();
          rays.tnear[i] = 0;
          rays.tfar[i] = 1;
          rays.time[i] = 0;
          rays.mask[i] = 0xffffffff;
          rays.flags[i] = 0;
        }
        if (!any) return false;
        mesh_.Occluded(active, rays);
        for (int i = 0; i < kLanes; ++i) {
          if (active[i] != 0 && rays.tfar[i] < 0) active[i] = 0;
        }
        return true;
      };
      for (int i = 0; i < kLanes; ++i) {
        active[i] = pending[i];
        // Repeated where the surface holds fewer probes.
        if (active[i] != 0 && k > 0) {
          const size_t first = size_t{target[i]} * kProbesPerTarget;
          if (probes_.positions_m[first + k] == probes_.positions_m[first]) active[i] = 0;
        }
      }
      if (!aim(to_camera) || !aim(to_laser)) continue;
      bool left = false;
      for (int i = 0; i < kLanes; ++i) {
        if (active[i] != 0) {
          covered.Set(target[i]);
          pending[i] = 0;
        }
        left |= pending[i] != 0;
      }
      if (!left) break;
    }
    lanes = 0;
  };
  for (size_t t = 0; t < targets_.size(); ++t) {
    const Eigen::Vector3f& p = targets_.positions_m[t];
    const Eigen::Vector3f& n = targets_.normals[t];
    const float s = gradient.dot(p) + offset;
    const Eigen::Vector3f c = camera - s * direction, l = laser - s * direction;
    const Eigen::Vector3f view = p - c, beam = p - l;
    if (n.dot(view) >= 0 || n.dot(beam) >= 0) continue;
    const float depth = view.dot(z_axis);
    if (depth <= 0 || std::abs(view.dot(x_axis)) > depth * tan_x ||
        std::abs(view.dot(y_axis)) > depth * tan_y || view.squaredNorm() > range * range) {
      continue;
    }
    const float laser_depth = beam.dot(laser_z);
    if (laser_depth <= 0 || std::abs(beam.dot(x_axis)) > laser_depth * fan) continue;
    target[lanes] = static_cast<uint32_t>(t);
    to_camera[lanes] = c;
    to_laser[lanes] = l;
    if (++lanes == kLanes) cast();
  }
  if (lanes > 0) cast();
  return covered;
}

}  // namespace sightline::bench
