// SPDX-License-Identifier: Apache-2.0
#include "report/plan/surface/display_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <tuple>
#include <unordered_map>

#include "core/part/point_index.h"

namespace sightline {
namespace {

using Triangle = std::array<uint32_t, 3>;

constexpr double kCreaseCosine = 0.76604444311897804;  // 40 degrees

// Weight of normals relative to positions in the search for the nearest target, in spacings:
// normals 30 degrees apart count like one spacing.
constexpr float kNormalSpacings = 2.0f;

uint64_t EdgeKey(uint32_t a, uint32_t b) {
  return (uint64_t{std::min(a, b)} << 32) | std::max(a, b);
}

TriangleMesh Simplify(const TriangleMesh& mesh, size_t max_triangles) {
  TriangleMesh result;
  std::vector<uint32_t> indices(3 * mesh.triangles.size());
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::copy(mesh.triangles[t].begin(), mesh.triangles[t].end(), indices.begin() + 3 * t);
  }
  const size_t count = meshopt_simplify(
      indices.data(), indices.data(), indices.size(), mesh.positions_m[0].data(),
      mesh.positions_m.size(), sizeof(Eigen::Vector3f), 3 * max_triangles, /*target_error=*/0.01f);
  result.positions_m = mesh.positions_m;
  for (size_t i = 0; i + 2 < count; i += 3) {
    result.triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
  }
  return result;
}

// One round of splitting; false if no edge was too long. Splitting an edge depends on its end
// points only, so both its triangles agree.
bool SplitOnce(TriangleMesh* mesh, float max_edge_squared) {
  std::unordered_map<uint64_t, uint32_t> midpoints;
  const auto midpoint = [&](uint32_t a, uint32_t b) -> int64_t {
    const Eigen::Vector3f& pa = mesh->positions_m[std::min(a, b)];
    const Eigen::Vector3f& pb = mesh->positions_m[std::max(a, b)];
    if ((pa - pb).squaredNorm() <= max_edge_squared) return -1;
    const auto [entry, is_new] =
        midpoints.try_emplace(EdgeKey(a, b), static_cast<uint32_t>(mesh->positions_m.size()));
    if (is_new) {
      const Eigen::Vector3f middle = 0.5f * (pa + pb);
      mesh->positions_m.push_back(middle);
    }
    return entry->second;
  };
  std::vector<Triangle> triangles;
  triangles.reserve(2 * mesh->triangles.size());
  for (const Triangle& t : mesh->triangles) {
    std::array<int64_t, 3> m;
    for (int c = 0; c < 3; ++c) m[c] = midpoint(t[c], t[(c + 1) % 3]);
    const int splits = (m[0] >= 0) + (m[1] >= 0) + (m[2] >= 0);
    const auto add = [&](int64_t a, int64_t b, int64_t c) {
      triangles.push_back(
          {static_cast<uint32_t>(a), static_cast<uint32_t>(b), static_cast<uint32_t>(c)});
    };
    if (splits == 0) {
      triangles.push_back(t);
    } else if (splits == 3) {
      add(t[0], m[0], m[2]);
      add(m[0], t[1], m[1]);
      add(m[2], m[1], t[2]);
      add(m[0], m[1], m[2]);
    } else {
      // Rotate so that edge 0 is split and, of two split edges, edge 2 is the whole one.
      int first = 0;
      while (m[first] < 0 || (splits == 2 && m[(first + 2) % 3] >= 0)) ++first;
      const uint32_t a = t[first], b = t[(first + 1) % 3], c = t[(first + 2) % 3];
      const int64_t ab = m[first], bc = m[(first + 1) % 3];
      if (splits == 1) {
        add(a, ab, c);
        add(ab, b, c);
      } else {
        add(ab, b, bc);
        const auto& p = mesh->positions_m;
        if ((p[ab] - p[c]).squaredNorm() < (p[a] - p[bc]).squaredNorm()) {
          add(a, ab, c);
          add(ab, bc, c);
        } else {
          add(a, ab, bc);
          add(a, bc, c);
        }
      }
    }
  }
  mesh->triangles = std::move(triangles);
  return !midpoints.empty();
}

std::vector<std::array<Eigen::Vector3f, 2>> FeatureEdges(const TriangleMesh& mesh) {
  struct Edge {
    uint64_t key;
    uint32_t triangle;
    bool operator<(const Edge& o) const {
      return std::tie(key, triangle) < std::tie(o.key, o.triangle);
    }
  };
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int c = 0; c < 3; ++c) {
      edges.push_back({EdgeKey(mesh.triangles[t][c], mesh.triangles[t][(c + 1) % 3]), t});
    }
  }
  std::sort(edges.begin(), edges.end());
  std::vector<std::array<Eigen::Vector3f, 2>> features;
  for (size_t i = 0; i < edges.size();) {
    size_t end = i;
    while (end < edges.size() && edges[end].key == edges[i].key) ++end;
    const bool smooth =
        end - i == 2 &&
        mesh.Normal(edges[i].triangle).dot(mesh.Normal(edges[i + 1].triangle)) > kCreaseCosine;
    if (!smooth) {
      features.push_back(
          {mesh.positions_m[edges[i].key >> 32], mesh.positions_m[edges[i].key & 0xffffffffu]});
    }
    i = end;
  }
  return features;
}

// For each corner, the area-weighted mean normal of the triangles around its vertex that are not
// beyond a crease. Corners with the same result share a vertex.
void SplitAtCreases(const TriangleMesh& mesh, DisplayMesh* display) {
  const size_t triangle_count = mesh.triangles.size();
  std::vector<Eigen::Vector3d> normals(triangle_count);
  std::vector<double> areas(triangle_count);
  std::vector<uint32_t> first(mesh.positions_m.size() + 1, 0);
  for (size_t t = 0; t < triangle_count; ++t) {
    normals[t] = mesh.Normal(t);
    areas[t] = mesh.Area(t);
    for (const uint32_t v : mesh.triangles[t]) ++first[v + 1];
  }
  for (size_t v = 0; v < mesh.positions_m.size(); ++v) first[v + 1] += first[v];
  std::vector<uint32_t> around(3 * triangle_count);
  std::vector<uint32_t> next(first.begin(), first.end() - 1);
  for (uint32_t t = 0; t < triangle_count; ++t) {
    for (const uint32_t v : mesh.triangles[t]) around[next[v]++] = t;
  }

  // Vertices made from each vertex of the mesh, as a linked list.
  constexpr uint32_t kNone = 0xffffffffu;
  std::vector<uint32_t> made(mesh.positions_m.size(), kNone);
  std::vector<uint32_t> next_made;
  display->triangles.resize(triangle_count);
  for (size_t t = 0; t < triangle_count; ++t) {
    for (int c = 0; c < 3; ++c) {
      const uint32_t v = mesh.triangles[t][c];
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (uint32_t i = first[v]; i < first[v + 1]; ++i) {
        if (normals[around[i]].dot(normals[t]) > kCreaseCosine)
          sum += areas[around[i]] * normals[around[i]];
      }
      const Eigen::Vector3f normal =
          (sum.norm() > 0 ? Eigen::Vector3d(sum.normalized()) : Eigen::Vector3d(0, 0, 1))
              .cast<float>();
      uint32_t vertex = made[v];
      while (vertex != kNone && (display->normals[vertex] - normal).squaredNorm() > 1e-4f) {
        vertex = next_made[vertex];
      }
      if (vertex == kNone) {
        vertex = static_cast<uint32_t>(display->positions_m.size());
        display->positions_m.push_back(mesh.positions_m[v]);
        display->normals.push_back(normal);
        next_made.push_back(made[v]);
        made[v] = vertex;
      }
      display->triangles[t][c] = vertex;
    }
  }
}

std::vector<uint32_t> NearestTargets(const DisplayMesh& mesh, const TargetSet& targets,
                                     double spacing_m) {
  if (targets.size() == 0) return {};
  using Point = PointIndex<6>::Point;
  const float normal_scale = kNormalSpacings * static_cast<float>(spacing_m);
  const auto point = [&](const Eigen::Vector3f& position, const Eigen::Vector3f& normal) {
    Point p;
    p << position, normal_scale * normal;
    return p;
  };
  std::vector<Point> points;
  points.reserve(targets.size());
  for (size_t i = 0; i < targets.size(); ++i) {
    points.push_back(point(targets.positions_m[i], targets.normals[i]));
  }
  const PointIndex<6> index(std::move(points));
  std::vector<uint32_t> nearest(mesh.positions_m.size());
  for (size_t v = 0; v < nearest.size(); ++v) {
    nearest[v] = index.Nearest(point(mesh.positions_m[v], mesh.normals[v]));
  }
  return nearest;
}

}  // namespace

TriangleMesh SubdivideLongEdges(const TriangleMesh& mesh, double max_edge_m) {
  assert(max_edge_m > 0);
  TriangleMesh result = mesh;
  const auto max_edge_squared = static_cast<float>(max_edge_m * max_edge_m);
  while (SplitOnce(&result, max_edge_squared)) {
  }
  return result;
}

DisplayMesh MakeDisplayMesh(const TriangleMesh& mesh, const TargetSet& targets, double spacing_m,
                            size_t max_triangles) {
  assert(max_triangles > 0 && spacing_m > 0);
  DisplayMesh display;
  if (mesh.triangles.empty()) return display;
  display.simplified = mesh.triangles.size() > max_triangles;
  const TriangleMesh coarse = display.simplified ? Simplify(mesh, max_triangles / 2) : mesh;
  display.feature_edges_m = FeatureEdges(coarse);

  // As fine as the targets if the budget allows, else coarser. Equilateral triangles of that edge
  // length need area / (sqrt(3)/4 edge^2) triangles; nothing finer fits the budget.
  double area_m2 = 0;
  for (size_t t = 0; t < coarse.triangles.size(); ++t) area_m2 += coarse.Area(t);
  const double diagonal_m = coarse.BoundingBox().diagonal().norm();
  double max_edge_m = std::max(
      spacing_m, std::sqrt(area_m2 / (std::sqrt(3.0) / 4 * static_cast<double>(max_triangles))));
  TriangleMesh fine = SubdivideLongEdges(coarse, max_edge_m);
  while (fine.triangles.size() > max_triangles && max_edge_m < diagonal_m) {
    max_edge_m *= 1.4;
    fine = SubdivideLongEdges(coarse, max_edge_m);
  }
  SplitAtCreases(fine, &display);
  display.nearest_target = NearestTargets(display, targets, spacing_m);
  return display;
}

}  // namespace sightline
