// SPDX-License-Identifier: Apache-2.0
#include "core/resting/resting_faces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

#include "core/part/surface_geometry.h"
#include "core/physics/angle.h"

namespace sightline {
namespace {

// A table that is not level and a hand that lets go tilt a part by a degree or two.
constexpr double kLeastStability_rad = 3 * kRadPerDeg;
// STEP translators and STL exports cut a turn into twelve facets or more: what lies on a facet less
// than this from the next one lies on something round.
constexpr double kRoundDihedral_rad = 31 * kRadPerDeg;
constexpr double kSameFace_rad = 1 * kRadPerDeg;
constexpr size_t kMostFaces = 12;
// A tessellated sphere stands on each of its facets.
constexpr size_t kMostCandidates = 2000;
// Corners this near to the plane of contact touch it; of the hull's diameter. Coordinates are
// floats (1e-7), CAD faces are planar to a few micrometres.
constexpr double kContactRelative = 5e-5;
// An engineer reads and sets no finer.
constexpr double kAngleStep_deg = 1e-3;

using Vector2 = Eigen::Vector2d;

double Cross(const Vector2& a, const Vector2& b) { return a.x() * b.y() - a.y() * b.x(); }

// Andrew's monotone chain; counter-clockwise, without collinear points.
std::vector<Vector2> Hull2d(std::vector<Vector2> points) {
  std::sort(points.begin(), points.end(), [](const Vector2& a, const Vector2& b) {
    return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y());
  });
  if (points.size() < 3) return points;
  std::vector<Vector2> hull(2 * points.size());
  size_t n = 0;
  const auto add = [&](const Vector2& p, size_t least) {
    while (n > least && Cross(hull[n - 1] - hull[n - 2], p - hull[n - 1]) <= 0) --n;
    hull[n++] = p;
  };
  for (const Vector2& p : points) add(p, 1);
  const size_t upper = n;
  for (size_t i = points.size() - 1; i-- > 0;) add(points[i], upper);
  hull.resize(n - 1);
  return hull;
}

double Diameter(const ConvexHull& hull) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& p : hull.corners_m) box.extend(p);
  return box.diagonal().norm();
}

// Contact of the part with a plane under it, seen along `normal` (outward, towards the table).
struct Contact {
  Eigen::Vector3d u, v;  // axes of the plane
  double height_m;       // normal . x of the plane
  std::vector<Vector2> outline;
  Vector2 foot;          // of the centre of mass
  double mass_height_m;  // of the centre of mass over the plane
};

Contact MakeContact(const ConvexHull& hull, const Eigen::Vector3d& mass_centre_m,
                    const Eigen::Vector3d& normal, double tolerance_m) {
  Contact contact;
  const auto axes = TangentAxes(normal);
  contact.u = axes[0];
  contact.v = axes[1];
  contact.height_m = SupportHeight(hull.corners_m, normal);
  std::vector<Vector2> touching;
  for (const Eigen::Vector3d& p : hull.corners_m) {
    if (normal.dot(p) < contact.height_m - tolerance_m) continue;
    touching.push_back({contact.u.dot(p), contact.v.dot(p)});
  }
  contact.outline = Hull2d(std::move(touching));
  contact.foot = {contact.u.dot(mass_centre_m), contact.v.dot(mass_centre_m)};
  contact.mass_height_m = contact.height_m - normal.dot(mass_centre_m);
  return contact;
}

struct WeakestEdge {
  double stability_rad = -1;  // < 0: it falls by itself
  Vector2 point, outward;
};

WeakestEdge FindWeakestEdge(const Contact& contact) {
  WeakestEdge weakest;
  if (contact.outline.size() < 3) return weakest;
  double least_m = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < contact.outline.size(); ++i) {
    const Vector2& a = contact.outline[i];
    const Vector2 along = (contact.outline[(i + 1) % contact.outline.size()] - a).normalized();
    const Vector2 outward(along.y(), -along.x());
    const double distance_m = outward.dot(a - contact.foot);
    if (distance_m >= least_m) continue;
    least_m = distance_m;
    weakest.point = a;
    weakest.outward = outward;
  }
  weakest.stability_rad = std::atan2(least_m, std::max(contact.mass_height_m, 0.0));
  return weakest;
}

// Toppled over its weakest edge the part comes to lie on a face less than kRoundDihedral_rad away
// on which it stands too: it rolls.
bool Rolls(const ConvexHull& hull, const Eigen::Vector3d& mass_centre_m,
           const Eigen::Vector3d& normal, const Contact& contact, const WeakestEdge& weakest,
           double tolerance_m) {
  double turn_rad = std::numbers::pi;
  for (const Eigen::Vector3d& p : hull.corners_m) {
    const double over_m = contact.height_m - normal.dot(p);
    if (over_m < tolerance_m) continue;
    const double beyond_m =
        weakest.outward.dot(Vector2(contact.u.dot(p), contact.v.dot(p)) - weakest.point);
    turn_rad = std::min(turn_rad, std::atan2(over_m, beyond_m));
  }
  if (turn_rad >= kRoundDihedral_rad || weakest.stability_rad > 0.75 * turn_rad) return false;
  const Eigen::Vector3d outward = weakest.outward.x() * contact.u + weakest.outward.y() * contact.v;
  const Eigen::Vector3d next = std::cos(turn_rad) * normal + std::sin(turn_rad) * outward;
  return FindWeakestEdge(MakeContact(hull, mass_centre_m, next, tolerance_m)).stability_rad > 0;
}

// Whether the foot of the centre of mass on the triangle's plane lies in the triangle.
bool FootInside(const std::array<Eigen::Vector3d, 3>& corner, const Eigen::Vector3d& normal,
                const Eigen::Vector3d& mass_centre_m, double tolerance_m) {
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d edge = corner[(k + 1) % 3] - corner[k];
    const Eigen::Vector3d inward = normal.cross(edge).normalized();
    if (inward.dot(mass_centre_m - corner[k]) < -tolerance_m) return false;
  }
  return true;
}

double RoundedTurn(double angle_rad) {
  double degrees = std::round(angle_rad / kRadPerDeg / kAngleStep_deg) * kAngleStep_deg;
  if (degrees < 0) degrees += 360;
  if (degrees >= 360) degrees -= 360;
  return degrees * kRadPerDeg;
}

RestingFace MakeFace(const Eigen::Vector3d& normal, const Contact& contact, double stability_rad) {
  RestingFace face;
  face.normal = normal;
  face.stability_rad = stability_rad;
  // R_x(alpha) turns the normal into the plane of x and z, downwards; R_y(beta) straight down.
  const double w = std::hypot(normal.y(), normal.z());
  face.part_alpha_rad =
      RoundedTurn(w > 1e-6 ? std::atan2(normal.y(), normal.z()) + std::numbers::pi : 0.0);
  face.part_beta_rad = RoundedTurn(std::atan2(normal.x(), w));
  Vector2 centroid = Vector2::Zero();
  double twice_area = 0;
  for (size_t i = 0; i < contact.outline.size(); ++i) {
    const Vector2& a = contact.outline[i];
    const Vector2& b = contact.outline[(i + 1) % contact.outline.size()];
    face.outline_m.push_back(a.x() * contact.u + a.y() * contact.v + contact.height_m * normal);
    const Vector2 origin = contact.outline[0];
    const double part = Cross(a - origin, b - origin);
    twice_area += part;
    centroid += part * ((a - origin) + (b - origin)) / 3;
  }
  if (twice_area > 0) {
    centroid = contact.outline[0] + centroid / twice_area;
  } else {
    centroid.setZero();
    for (const Vector2& p : contact.outline) centroid += p;
    centroid /= static_cast<double>(std::max<size_t>(1, contact.outline.size()));
  }
  face.centre_m = centroid.x() * contact.u + centroid.y() * contact.v + contact.height_m * normal;
  face.area_m2 = 0.5 * twice_area;
  return face;
}

// Volume and first moments of a closed mesh about `origin`, each times 6 and 24.
struct VolumeMoments {
  double volume6 = 0;
  Eigen::Vector3d first24 = Eigen::Vector3d::Zero();
  void Add(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
    const double determinant = a.dot(b.cross(c));
    volume6 += determinant;
    first24 += determinant * (a + b + c);
  }
  Eigen::Vector3d Centre() const { return first24 / (4 * volume6); }
};

// Every directed edge has as many opposite ones.
bool IsClosed(const TriangleMesh& mesh) {
  std::vector<std::pair<uint64_t, int8_t>> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      const uint64_t a = t[k], b = t[(k + 1) % 3];
      if (a == b) continue;
      edges.push_back({a < b ? a << 32 | b : b << 32 | a, static_cast<int8_t>(a < b ? 1 : -1)});
    }
  }
  std::sort(edges.begin(), edges.end());
  for (size_t i = 0; i < edges.size();) {
    int64_t sum = 0;
    const uint64_t edge = edges[i].first;
    for (; i < edges.size() && edges[i].first == edge; ++i) sum += edges[i].second;
    if (sum != 0) return false;
  }
  return true;
}

}  // namespace

Eigen::Vector3d MassCentre(const TriangleMesh& mesh, const ConvexHull& hull) {
  const Eigen::Vector3d origin = mesh.BoundingBox().center();
  VolumeMoments of_hull;
  for (const auto& t : hull.triangles) {
    of_hull.Add(hull.corners_m[t[0]] - origin, hull.corners_m[t[1]] - origin,
                hull.corners_m[t[2]] - origin);
  }
  // Below this the mesh is a sheet whose two sides cancel.
  constexpr double kLeastFilling = 1e-4;
  if (IsClosed(mesh)) {
    VolumeMoments of_mesh;
    for (size_t t = 0; t < mesh.triangles.size(); ++t) {
      of_mesh.Add(mesh.Corner(t, 0) - origin, mesh.Corner(t, 1) - origin,
                  mesh.Corner(t, 2) - origin);
    }
    if (of_mesh.volume6 > kLeastFilling * of_hull.volume6 &&
        mesh.BoundingBox().contains(of_mesh.Centre() + origin)) {
      return of_mesh.Centre() + origin;
    }
  }
  return of_hull.Centre() + origin;
}

std::vector<RestingFace> FindRestingFaces(const ConvexHull& hull,
                                          const Eigen::Vector3d& mass_centre_m) {
  const double tolerance_m = kContactRelative * Diameter(hull);
  // Facets that hold the foot of the centre of mass, the largest first. Coplanar triangles are one
  // face: one of them holds it.
  struct Candidate {
    double area;
    Eigen::Vector3d normal;
  };
  std::vector<Candidate> candidates;
  for (const auto& t : hull.triangles) {
    const std::array<Eigen::Vector3d, 3> corner = {hull.corners_m[t[0]], hull.corners_m[t[1]],
                                                   hull.corners_m[t[2]]};
    const Eigen::Vector3d n = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
    if (!(n.norm() > 0)) continue;
    const Eigen::Vector3d normal = n.normalized();
    if (FootInside(corner, normal, mass_centre_m, tolerance_m)) {
      candidates.push_back({0.5 * n.norm(), normal});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::tuple(-a.area, a.normal.x(), a.normal.y(), a.normal.z()) <
           std::tuple(-b.area, b.normal.x(), b.normal.y(), b.normal.z());
  });
  if (candidates.size() > kMostCandidates) candidates.resize(kMostCandidates);

  std::vector<RestingFace> faces;
  for (const Candidate& candidate : candidates) {
    const Eigen::Vector3d& normal = candidate.normal;
    const bool known = std::any_of(faces.begin(), faces.end(), [&](const RestingFace& face) {
      return face.normal.dot(normal) > std::cos(kSameFace_rad);
    });
    if (known) continue;
    const Contact contact = MakeContact(hull, mass_centre_m, normal, tolerance_m);
    const WeakestEdge weakest = FindWeakestEdge(contact);
    if (weakest.stability_rad < kLeastStability_rad) continue;
    if (Rolls(hull, mass_centre_m, normal, contact, weakest, tolerance_m)) continue;
    faces.push_back(MakeFace(normal, contact, weakest.stability_rad));
  }
  // Equally stable ones: first the one nearest to how the CAD model stands.
  const auto key = [](const RestingFace& face) {
    const auto round = [](double x) { return std::round(x * 1e4); };
    return std::tuple(-round(face.stability_rad), round(face.normal.z()), round(face.normal.y()),
                      round(face.normal.x()));
  };
  std::stable_sort(faces.begin(), faces.end(),
                   [&](const RestingFace& a, const RestingFace& b) { return key(a) < key(b); });
  if (faces.size() > kMostFaces) faces.resize(kMostFaces);
  for (size_t i = 0; i < faces.size(); ++i)
    faces[i].name = std::string(1, static_cast<char>('A' + i));
  return faces;
}

RestingFace DescribeRest(const ConvexHull& hull, const Eigen::Vector3d& mass_centre_m,
                         double part_alpha_rad, double part_beta_rad) {
  const Eigen::Vector3d normal = -((Eigen::AngleAxisd(part_beta_rad, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(part_alpha_rad, Eigen::Vector3d::UnitX()))
                                       .toRotationMatrix()
                                       .row(2)
                                       .transpose());
  // Angles are given to a few digits, so points slightly above the plane touch it too.
  const double tolerance_m = 4 * kContactRelative * Diameter(hull);
  const Contact contact = MakeContact(hull, mass_centre_m, normal, tolerance_m);
  RestingFace face =
      MakeFace(normal, contact, std::max(0.0, FindWeakestEdge(contact).stability_rad));
  face.part_alpha_rad = part_alpha_rad;
  face.part_beta_rad = part_beta_rad;
  return face;
}

}  // namespace sightline
