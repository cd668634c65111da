// SPDX-License-Identifier: Apache-2.0
// The same definitions decided by Embree's rays: an independent judge that shares no code with the
// engine's occlusion, cutting and visibility.
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Core>
#include <vector>

#include "core/part/mesh.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"

namespace sightline {

struct JudgePoint {
  Eigen::Vector3d position_m;  // part coordinates
  Eigen::Vector3d normal;
  int frame;
  int column_px;
};

class EmbreeJudge {
 public:
  explicit EmbreeJudge(const TriangleMesh& mesh);
  ~EmbreeJudge();
  EmbreeJudge(const EmbreeJudge&) = delete;
  EmbreeJudge& operator=(const EmbreeJudge&) = delete;

  // Something lies on the segment from `from` to within `gap_m` of `to`.
  bool Occluded(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double gap_m) const;
  // Something lies in `direction` from `from`, farther than `gap_m`.
  bool Hidden(const Eigen::Vector3d& from, const Eigen::Vector3d& direction, double gap_m) const;

  struct Hit {
    Eigen::Vector3d position_m;
    uint32_t triangle;
  };
  // All crossings of a line with the surface within `reach_m` of `point`, in order.
  std::vector<Hit> Crossings(const Eigen::Vector3d& point, const Eigen::Vector3d& direction,
                             double reach_m) const;

  // Measured points of one frame: an image column and the laser sheet are two planes, so the
  // points are where their common line pierces the surface, as far as lit and seen.
  std::vector<JudgePoint> Frame(const Rig& rig, const Measurement& measurement, int frame) const;

 private:
  const TriangleMesh& mesh_;
  RTCDevice device_;
  RTCScene scene_;
};

}  // namespace sightline
