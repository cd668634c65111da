// SPDX-License-Identifier: Apache-2.0
// Probe points around each target, at places where a measurement point would cover the target.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <vector>

#include "core/part/mesh.h"
#include "core/targets/target_set.h"
#include "coverage_server/occlusion/triangle_bvh.h"

namespace sightline {

inline constexpr int kProbesPerTarget = 8;
// A measurement point may lie anywhere in the disc of the coverage radius. Probes at this fraction
// of the radius represent the rim.
inline constexpr float kProbeRadiusRelative = 0.8f;

// Probe 0 is the target; the others lie on the surface within the coverage radius, on triangles
// that pass the normal gate. Where the surface ends, fewer distinct probes exist and the target is
// repeated. Index: target * kProbesPerTarget + probe.
struct SurfaceProbes {
  std::vector<Eigen::Vector3f> positions_m;
  std::vector<Eigen::Vector3f> normals;
};

// Stops early, with an unspecified result, when *cancelled; may be null.
SurfaceProbes MakeSurfaceProbes(const TriangleMesh& mesh, const TriangleBvh& bvh,
                                const TargetSet& targets, const TargetSampling& sampling,
                                const std::atomic<bool>* cancelled = nullptr);

}  // namespace sightline
