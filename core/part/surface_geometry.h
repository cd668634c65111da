// SPDX-License-Identifier: Apache-2.0
// Small geometry of surfaces that several modules need.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>

namespace sightline {

// Two unit vectors u, v that are perpendicular to the unit vector `normal`, with u x v = normal.
// Which ones is the same everywhere, so that places in a tangent plane can be compared.
template <typename T>
std::array<Eigen::Matrix<T, 3, 1>, 2> TangentAxes(const Eigen::Matrix<T, 3, 1>& normal) {
  using Vector = Eigen::Matrix<T, 3, 1>;
  const Vector u =
      normal.cross(std::abs(normal.x()) < T(0.7) ? Vector::UnitX() : Vector::UnitY()).normalized();
  return {u, normal.cross(u)};
}

// Point of the triangle a, b, c nearest to p (Ericson, Real-Time Collision Detection, 2005, 5.1.5).
// Of a triangle without area some point of it.
template <typename T>
Eigen::Matrix<T, 3, 1> ClosestOnTriangle(const Eigen::Matrix<T, 3, 1>& p,
                                         const Eigen::Matrix<T, 3, 1>& a,
                                         const Eigen::Matrix<T, 3, 1>& b,
                                         const Eigen::Matrix<T, 3, 1>& c) {
  using Vector = Eigen::Matrix<T, 3, 1>;
  const Vector ab = b - a, ac = c - a, ap = p - a;
  const T d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vector bp = p - b;
  const T d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const T vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const Vector cp = p - c;
  const T d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const T vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const T va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  }
  const T denominator = va + vb + vc;
  if (denominator == 0) return a;
  return a + ab * (vb / denominator) + ac * (vc / denominator);
}

}  // namespace sightline
