// SPDX-License-Identifier: Apache-2.0
#include "core/registration/deformed_mesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/part/point_index.h"

namespace sightline {
namespace {

// Halvings of the longest edge of a part (10 m) to the smallest spacing (0.1 mm).
constexpr int kMaxRounds = 18;

using Edge = std::pair<uint32_t, uint32_t>;  // ascending

Edge EdgeOf(uint32_t a, uint32_t b) { return a < b ? Edge(a, b) : Edge(b, a); }

class Refiner {
 public:
  Refiner(TriangleMesh mesh, const DeviationField& field, size_t most_triangles)
      : mesh_(std::move(mesh)),
        most_triangles_(most_triangles),
        spacing_m_(field.spacing_m),
        moved_(MovedPlaces(field)) {}

  TriangleMesh Refine() {
    if (moved_.points().empty()) return std::move(mesh_);
    for (int round = 0; round < kMaxRounds && Halve(); ++round) {
    }
    return std::move(mesh_);
  }

 private:
  static std::vector<Eigen::Vector3f> MovedPlaces(const DeviationField& field) {
    std::vector<Eigen::Vector3f> places;
    for (size_t i = 0; i < field.positions_m.size(); ++i) {
      if (field.deviations_m[i] != 0) places.push_back(field.positions_m[i]);
    }
    return places;
  }

  // Whether a place that moves may lie on the triangle or near it.
  bool HoldsDeviation(const std::array<uint32_t, 3>& triangle) const {
    const Eigen::Vector3f& a = mesh_.positions_m[triangle[0]];
    const Eigen::Vector3f& b = mesh_.positions_m[triangle[1]];
    const Eigen::Vector3f& c = mesh_.positions_m[triangle[2]];
    const Eigen::Vector3f centre = (a + b + c) / 3;
    const float radius = std::max({(a - centre).norm(), (b - centre).norm(), (c - centre).norm()});
    return (moved_.points()[moved_.Nearest(centre)] - centre).norm() <
           radius + 2 * static_cast<float>(spacing_m_);
  }

  bool Halve() {
    std::map<Edge, uint32_t> middles;
    for (const auto& triangle : mesh_.triangles) {
      if (mesh_.triangles.size() + 3 * middles.size() > most_triangles_) break;
      double longest_m = 0;
      for (int k = 0; k < 3; ++k) {
        longest_m = std::max(longest_m, Length(triangle[k], triangle[(k + 1) % 3]));
      }
      if (longest_m <= spacing_m_ || !HoldsDeviation(triangle)) continue;
      for (int k = 0; k < 3; ++k) {
        const uint32_t a = triangle[k], b = triangle[(k + 1) % 3];
        const double length_m = Length(a, b);
        // The longest edge goes first, so that pieces do not become thinner than the triangle.
        if (length_m <= spacing_m_ || length_m < 0.7 * longest_m) continue;
        middles.try_emplace(EdgeOf(a, b), 0);
      }
    }
    if (middles.empty()) return false;
    for (auto& [edge, index] : middles) {
      index = static_cast<uint32_t>(mesh_.positions_m.size());
      mesh_.positions_m.push_back(0.5f *
                                  (mesh_.positions_m[edge.first] + mesh_.positions_m[edge.second]));
    }
    std::vector<std::array<uint32_t, 3>> triangles;
    std::vector<uint16_t> materials;
    const auto add = [&](uint32_t a, uint32_t b, uint32_t c, size_t of) {
      triangles.push_back({a, b, c});
      if (!mesh_.triangle_material.empty()) materials.push_back(mesh_.triangle_material[of]);
    };
    for (size_t t = 0; t < mesh_.triangles.size(); ++t) {
      std::array<uint32_t, 3> v = mesh_.triangles[t];
      std::array<const uint32_t*, 3> m;  // middle of the edge after each corner, or null
      int halved = 0;
      for (int k = 0; k < 3; ++k) {
        const auto found = middles.find(EdgeOf(v[k], v[(k + 1) % 3]));
        m[k] = found == middles.end() ? nullptr : &found->second;
        halved += m[k] != nullptr;
      }
      // Turned so that one halved edge is the first, of two the first and the second.
      const auto turn = [&] {
        std::rotate(v.begin(), v.begin() + 1, v.end());
        std::rotate(m.begin(), m.begin() + 1, m.end());
      };
      if (halved == 0) {
        add(v[0], v[1], v[2], t);
      } else if (halved == 1) {
        while (m[0] == nullptr) turn();
        add(v[0], *m[0], v[2], t);
        add(*m[0], v[1], v[2], t);
      } else if (halved == 2) {
        while (m[2] != nullptr) turn();
        add(*m[0], v[1], *m[1], t);
        add(v[0], *m[0], *m[1], t);
        add(v[0], *m[1], v[2], t);
      } else {
        for (int k = 0; k < 3; ++k) add(v[k], *m[k], *m[(k + 2) % 3], t);
        add(*m[0], *m[1], *m[2], t);
      }
    }
    mesh_.triangles = std::move(triangles);
    mesh_.triangle_material = std::move(materials);
    return true;
  }

  double Length(uint32_t a, uint32_t b) const {
    return (mesh_.positions_m[a] - mesh_.positions_m[b]).norm();
  }

  TriangleMesh mesh_;
  size_t most_triangles_;
  double spacing_m_;
  PointIndex<3> moved_;
};

}  // namespace

TriangleMesh DeformMesh(const TriangleMesh& mesh, const DeviationField& field,
                        size_t most_triangles) {
  if (std::all_of(field.deviations_m.begin(), field.deviations_m.end(),
                  [](double d) { return d == 0; })) {
    return mesh;
  }
  TriangleMesh deformed = Refiner(mesh, field, most_triangles).Refine();
  std::vector<Eigen::Vector3d> normals(deformed.positions_m.size(), Eigen::Vector3d::Zero());
  for (size_t t = 0; t < deformed.triangles.size(); ++t) {
    const Eigen::Vector3d weighted = deformed.Area(t) * deformed.Normal(t);
    for (const uint32_t v : deformed.triangles[t]) normals[v] += weighted;
  }
  const PointIndex<3> index(field.positions_m);
  const double width_m = 0.5 * field.spacing_m;
  for (size_t v = 0; v < deformed.positions_m.size(); ++v) {
    const double length = normals[v].norm();
    if (length == 0) continue;
    const Eigen::Vector3d normal = normals[v] / length;
    std::vector<uint32_t> near = index.Within(deformed.positions_m[v], 2 * field.spacing_m);
    std::sort(near.begin(), near.end());
    double weight_sum = 0, sum_m = 0;
    for (const uint32_t i : near) {
      if (field.normals[i].cast<double>().dot(normal) < 0.5) continue;
      const double r_m = (field.positions_m[i] - deformed.positions_m[v]).norm();
      const double weight = std::exp(-0.5 * r_m * r_m / (width_m * width_m));
      weight_sum += weight;
      sum_m += weight * field.deviations_m[i];
    }
    if (weight_sum > 0) {
      deformed.positions_m[v] += (sum_m / weight_sum * normal).cast<float>();
    }
  }
  return deformed;
}

}  // namespace sightline
