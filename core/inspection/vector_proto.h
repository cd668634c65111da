// SPDX-License-Identifier: Apache-2.0
// Vectors of messages as vectors of Eigen and back, number by number.
#pragma once

#include <Eigen/Core>

#include "sightline/v1/geometry.pb.h"

namespace sightline {

inline Eigen::Vector3d VectorFromProto(const v1::Vector3& message) {
  return {message.x(), message.y(), message.z()};
}

inline v1::Vector3 VectorToProto(const Eigen::Vector3d& vector) {
  v1::Vector3 message;
  message.set_x(vector.x());
  message.set_y(vector.y());
  message.set_z(vector.z());
  return message;
}

}  // namespace sightline
