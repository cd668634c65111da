// SPDX-License-Identifier: Apache-2.0
#include "tests/core/part/test_meshes.h"

#include <cmath>
#include <cstdlib>
#include <map>
#include <utility>

namespace sightline {

TriangleMesh BoxMesh(const Eigen::Vector3f& min_m, const Eigen::Vector3f& max_m) {
  TriangleMesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    mesh.positions_m.emplace_back(corner & 1 ? max_m.x() : min_m.x(),
                                  corner & 2 ? max_m.y() : min_m.y(),
                                  corner & 4 ? max_m.z() : min_m.z());
  }
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

TriangleMesh Flipped(TriangleMesh mesh) {
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  return mesh;
}

TriangleMesh Merged(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh mesh = a;
  const uint32_t base = static_cast<uint32_t>(a.positions_m.size());
  mesh.positions_m.insert(mesh.positions_m.end(), b.positions_m.begin(), b.positions_m.end());
  for (const auto& t : b.triangles) {
    mesh.triangles.push_back({base + t[0], base + t[1], base + t[2]});
  }
  return mesh;
}

TriangleMesh PlateMesh(double width_m, double height_m, int columns, int rows) {
  TriangleMesh mesh;
  for (int y = 0; y <= rows; ++y) {
    for (int x = 0; x <= columns; ++x) {
      mesh.positions_m.emplace_back(static_cast<float>(width_m * x / columns),
                                    static_cast<float>(height_m * y / rows), 0.0f);
    }
  }
  const auto at = [&](int x, int y) { return static_cast<uint32_t>(y * (columns + 1) + x); };
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      mesh.triangles.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      mesh.triangles.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  }
  return mesh;
}

TriangleMesh SphereMesh(double radius_m, int levels) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  std::vector<Eigen::Vector3d> points = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                                         {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                                         {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
  std::vector<std::array<uint32_t, 3>> triangles = {
      {0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (Eigen::Vector3d& p : points) p.normalize();
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    const auto middle = [&](uint32_t a, uint32_t b) {
      const auto [it, added] = middles.try_emplace({std::min(a, b), std::max(a, b)},
                                                   static_cast<uint32_t>(points.size()));
      if (added) points.push_back((points[a] + points[b]).normalized());
      return it->second;
    };
    std::vector<std::array<uint32_t, 3>> finer;
    for (const auto& [a, b, c] : triangles) {
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    triangles = std::move(finer);
  }
  TriangleMesh mesh;
  for (const Eigen::Vector3d& p : points) mesh.positions_m.push_back((radius_m * p).cast<float>());
  mesh.triangles = std::move(triangles);
  return mesh;
}

std::optional<std::filesystem::path> SharedData() {
  std::filesystem::path folder;
  if (const char* shared = std::getenv("SIGHTLINE_SHARED_DIR")) {
    folder = shared;
  } else if (const char* source = std::getenv("SIGHTLINE_SOURCE_DIR")) {
    folder = std::filesystem::path(source) / ".." / "shared";
  } else {
    return std::nullopt;
  }
  if (!std::filesystem::is_directory(folder / "data")) return std::nullopt;
  return folder;
}

}  // namespace sightline
