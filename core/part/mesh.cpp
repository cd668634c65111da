// SPDX-License-Identifier: Apache-2.0
#include "core/part/mesh.h"

namespace sightline {

Eigen::AlignedBox3d TriangleMesh::BoundingBox() const {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& position : positions_m) box.extend(position.cast<double>());
  return box;
}

Eigen::Vector3d TriangleMesh::Normal(size_t t) const {
  const Eigen::Vector3d a = Corner(t, 0);
  const Eigen::Vector3d n = (Corner(t, 1) - a).cross(Corner(t, 2) - a);
  const double length = n.norm();
  return length > 0 ? Eigen::Vector3d(n / length) : Eigen::Vector3d::Zero();
}

double TriangleMesh::Area(size_t t) const {
  const Eigen::Vector3d a = Corner(t, 0);
  return 0.5 * (Corner(t, 1) - a).cross(Corner(t, 2) - a).norm();
}

}  // namespace sightline
