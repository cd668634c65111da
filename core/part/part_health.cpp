// SPDX-License-Identifier: Apache-2.0
#include "core/part/part_health.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "core/part/disjoint_sets.h"

namespace sightline {
namespace {

// Looks at components and triangles to find out which component lies in which: some seconds. Parts
// have few components; a file made for it could have a million, one in the other.
constexpr int64_t kMostNestingSteps = 300'000'000;

// One side of a triangle; `from < to` after ordering, `forward` says whether it was so before.
struct HalfEdge {
  uint32_t low, high;
  uint32_t triangle;
  bool forward;
};

struct Component {
  std::vector<uint32_t> triangles;
  Eigen::AlignedBox3d box;
  double volume_m3 = 0;
  bool closed = true;      // every edge has exactly two triangles
  bool consistent = true;  // neighbours agree which side is outside
};

bool IsDegenerate(const TriangleMesh& mesh, size_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  if (a == b || b == c || c == a) return true;
  // Height over the longest side below a millionth of it: rounding decides about its normal.
  const Eigen::Vector3d p = mesh.Corner(t, 0), q = mesh.Corner(t, 1), r = mesh.Corner(t, 2);
  const double longest2 =
      std::max({(q - p).squaredNorm(), (r - q).squaredNorm(), (p - r).squaredNorm()});
  return 2 * mesh.Area(t) <= 1e-6 * longest2;
}

// Triangles with area on the same three vertices.
struct Repetitions {
  int64_t duplicates = 0;  // all but the first on their vertices
  int64_t two_sided = 0;   // pairs that face opposite ways
  std::vector<bool> in_pair;
};

Repetitions FindRepetitions(const TriangleMesh& mesh, const std::vector<bool>& degenerate) {
  struct OnVertices {
    std::array<uint32_t, 3> sorted;
    bool odd;  // orientation: odd permutation of the corners
    uint32_t triangle;
  };
  std::vector<OnVertices> all;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (degenerate[t]) continue;
    std::array<uint32_t, 3> v = mesh.triangles[t];
    const bool odd = (v[0] > v[1]) != ((v[1] > v[2]) != (v[0] > v[2]));
    std::sort(v.begin(), v.end());
    all.push_back({v, odd, t});
  }
  std::sort(all.begin(), all.end(), [](const OnVertices& a, const OnVertices& b) {
    return std::tie(a.sorted, a.odd, a.triangle) < std::tie(b.sorted, b.odd, b.triangle);
  });
  Repetitions repetitions;
  repetitions.in_pair.assign(mesh.triangles.size(), false);
  for (size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    int64_t odd = 0;
    for (end = begin; end < all.size() && all[end].sorted == all[begin].sorted; ++end) {
      odd += all[end].odd;
    }
    const auto count = static_cast<int64_t>(end - begin);
    repetitions.duplicates += count - 1;
    const int64_t pairs = std::min(odd, count - odd);
    repetitions.two_sided += pairs;
    for (size_t i = begin; i < end && pairs > 0; ++i) {
      repetitions.in_pair[all[i].triangle] = true;
    }
  }
  return repetitions;
}

// Sign of the turn from edge (a, b) to p in the yz plane. The corners are taken in the order of
// their indices, so that both triangles of an edge compute the same number: a line along x then
// crosses a closed surface an even number of times, even through its edges.
double EdgeSide(const TriangleMesh& mesh, uint32_t a, uint32_t b, const Eigen::Vector3d& p) {
  const double sign = a < b ? 1 : -1;
  if (a > b) std::swap(a, b);
  const Eigen::Vector3d u = mesh.positions_m[a].cast<double>();
  const Eigen::Vector3d v = mesh.positions_m[b].cast<double>();
  const double side = (v.y() - u.y()) * (p.z() - u.z()) - (v.z() - u.z()) * (p.y() - u.y());
  return sign * (side == 0 ? 1e-300 : side);
}

// Even-odd rule along +x.
bool Inside(const TriangleMesh& mesh, const Component& component, const Eigen::Vector3d& p) {
  bool inside = false;
  for (uint32_t t : component.triangles) {
    const auto& [a, b, c] = mesh.triangles[t];
    const double ab = EdgeSide(mesh, a, b, p), bc = EdgeSide(mesh, b, c, p),
                 ca = EdgeSide(mesh, c, a, p);
    if ((ab > 0) != (bc > 0) || (bc > 0) != (ca > 0)) continue;
    // ab, bc, ca are the barycentric weights of c, a, b.
    const double sum = ab + bc + ca;
    const double x = (bc * mesh.positions_m[a].x() + ca * mesh.positions_m[b].x() +
                      ab * mesh.positions_m[c].x()) /
                     sum;
    if (x > p.x()) inside = !inside;
  }
  return inside;
}

std::string Count(int64_t count, const std::string& one, const std::string& many) {
  return absl::StrCat(count, " ", count == 1 ? one : many);
}

}  // namespace

PartHealth CheckPartHealth(const TriangleMesh& mesh) {
  PartHealth health;
  const size_t triangle_count = mesh.triangles.size();
  health.triangle_count = static_cast<int64_t>(triangle_count);
  health.vertex_count = static_cast<int64_t>(mesh.positions_m.size());
  health.bounding_box_m = mesh.BoundingBox();
  std::vector<bool> degenerate(triangle_count);
  for (size_t t = 0; t < triangle_count; ++t) {
    health.area_m2 += mesh.Area(t);
    degenerate[t] = IsDegenerate(mesh, t);
    health.degenerate_triangle_count += degenerate[t];
  }

  health.degenerate_triangle_count += mesh.left_out_triangles;
  const Repetitions repetitions = FindRepetitions(mesh, degenerate);
  health.duplicate_triangle_count = repetitions.duplicates;

  std::vector<HalfEdge> edges;
  edges.reserve(3 * triangle_count);
  for (size_t t = 0; t < triangle_count; ++t) {
    const auto& v = mesh.triangles[t];
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;  // a line has no neighbours
    for (int k = 0; k < 3; ++k) {
      const uint32_t from = v[k], to = v[(k + 1) % 3];
      edges.push_back(
          {std::min(from, to), std::max(from, to), static_cast<uint32_t>(t), from < to});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  DisjointSets sets(triangle_count);
  std::vector<bool> open(triangle_count), disagrees(triangle_count);
  int64_t inconsistent_edges = 0, sheet_edges = 0;
  double open_length_m = 0;
  for (size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    int forward = 0;
    for (end = begin; end < edges.size() && edges[end].low == edges[begin].low &&
                      edges[end].high == edges[begin].high;
         ++end) {
      forward += edges[end].forward;
      sets.Join(edges[begin].triangle, edges[end].triangle);
    }
    const size_t count = end - begin;
    if (count == 1) {
      ++health.open_edge_count;
      open_length_m += (mesh.positions_m[edges[begin].low] - mesh.positions_m[edges[begin].high])
                           .cast<double>()
                           .norm();
    }
    if (count > 2) {
      ++health.non_manifold_edge_count;
      sheet_edges +=
          std::all_of(edges.begin() + static_cast<std::ptrdiff_t>(begin),
                      edges.begin() + static_cast<std::ptrdiff_t>(end),
                      [&](const HalfEdge& edge) { return repetitions.in_pair[edge.triangle]; });
    }
    const bool disagree = count == 2 && forward != 1;
    inconsistent_edges += disagree;
    for (size_t i = begin; i < end; ++i) {
      if (count != 2) open[edges[i].triangle] = true;
      if (disagree) disagrees[edges[i].triangle] = true;
    }
  }

  std::vector<Component> components;
  std::vector<uint32_t> component_of(triangle_count, 0);
  for (size_t t = 0; t < triangle_count; ++t) {
    const auto& v = mesh.triangles[t];
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    const uint32_t root = sets.Find(static_cast<uint32_t>(t));
    if (root == t) {
      component_of[t] = static_cast<uint32_t>(components.size());
      components.emplace_back();
    }
    Component& component = components[component_of[root]];
    component.triangles.push_back(static_cast<uint32_t>(t));
    component.closed = component.closed && !open[t];
    component.consistent = component.consistent && !disagrees[t];
    // Relative to the part's centre, which keeps rounding small.
    const Eigen::Vector3d centre = health.bounding_box_m.center();
    const Eigen::Vector3d a = mesh.Corner(t, 0) - centre, b = mesh.Corner(t, 1) - centre,
                          c = mesh.Corner(t, 2) - centre;
    component.volume_m3 += a.dot(b.cross(c)) / 6;
    for (int k = 0; k < 3; ++k) component.box.extend(mesh.Corner(t, k));
  }
  health.component_count = static_cast<int64_t>(components.size());

  // In how many closed components each of them lies. Along x, these begin no later than it.
  std::vector<uint32_t> by_begin;
  for (uint32_t i = 0; i < components.size(); ++i) {
    if (components[i].closed) by_begin.push_back(i);
  }
  std::sort(by_begin.begin(), by_begin.end(), [&](uint32_t a, uint32_t b) {
    return std::tuple(components[a].box.min().x(), a) < std::tuple(components[b].box.min().x(), b);
  });
  std::vector<int> depth(components.size(), 0);
  int64_t nesting_steps = 0;
  const auto look = [&](uint32_t inner, uint32_t outer) {
    const Component& component = components[inner];
    if (!components[outer].box.contains(component.box)) return;
    if (!component.consistent || component.volume_m3 == 0) return;
    nesting_steps += static_cast<int64_t>(components[outer].triangles.size());
    // Any point of its surface does: closed components either enclose all of it or none.
    depth[inner] += Inside(mesh, components[outer], mesh.Corner(component.triangles.front(), 0));
  };
  std::vector<uint32_t> around;  // have begun and not ended
  for (const uint32_t i : by_begin) {
    const Eigen::AlignedBox3d& box = components[i].box;
    if (nesting_steps > kMostNestingSteps) break;
    nesting_steps += static_cast<int64_t>(around.size());
    std::erase_if(around, [&](uint32_t j) { return components[j].box.max().x() < box.min().x(); });
    for (const uint32_t j : around) {
      if (nesting_steps > kMostNestingSteps) break;
      look(i, j);
      look(j, i);  // boxes that begin at the same place
    }
    around.push_back(i);
  }

  int64_t open_components = 0, enclosed_components = 0;
  for (size_t i = 0; i < components.size(); ++i) {
    const Component& component = components[i];
    if (!component.closed) {
      ++open_components;
      continue;
    }
    if (!component.consistent || component.volume_m3 == 0) continue;
    if (nesting_steps > kMostNestingSteps) continue;
    const bool outward = component.volume_m3 > 0;
    enclosed_components += depth[i] > 0;
    health.flipped_component_count += outward != (depth[i] % 2 == 0);
  }

  std::vector<std::string>& findings = health.findings;
  if (triangle_count == 0) {
    findings.push_back("The part has no triangles: there is nothing to plan for.");
    return health;
  }
  if (health.open_edge_count > 0) {
    findings.push_back(absl::StrCat(
        "The surface has holes: ", Count(health.open_edge_count, "edge has", "edges have"),
        " only one triangle (", static_cast<int64_t>(std::lround(open_length_m * 1e3)),
        " mm of rim, ", Count(open_components, "component", "components"), " of ",
        health.component_count,
        "). Light and sight pass through holes, so places behind them may look measurable that are "
        "not; inner sides that show through are not measured."));
  }
  if (health.flipped_component_count > 0) {
    findings.push_back(absl::StrCat(
        Count(health.flipped_component_count, "closed component is", "closed components are"),
        " inside out: the normals point into the material. Such a surface counts as facing away "
        "from every camera and would never be measured; flip it in the CAD program."));
  }
  if (inconsistent_edges > 0) {
    findings.push_back(absl::StrCat(
        "Neighbouring triangles disagree which side is outside along ",
        Count(inconsistent_edges, "edge", "edges"),
        ". The wrongly turned triangles count as facing away and would never be measured."));
  }
  // Edges between two-sided sheets are no inner walls.
  if (const int64_t edges_left = health.non_manifold_edge_count - sheet_edges; edges_left > 0) {
    findings.push_back(absl::StrCat(
        Count(edges_left, "edge has", "edges have"),
        " more than two triangles (bodies that touch along an edge, or inner walls). Planning "
        "works, but inner walls get targets that no scan can reach."));
  }
  if (repetitions.two_sided > 0) {
    findings.push_back(absl::StrCat(
        Count(repetitions.two_sided, "triangle is", "triangles are"),
        " there twice, facing opposite ways: a sheet without thickness with two sides, or a wall "
        "between two bodies. Each side gets targets of its own; those of a wall inside material "
        "cannot be measured."));
  }
  if (const int64_t copies = health.duplicate_triangle_count - repetitions.two_sided; copies > 0) {
    findings.push_back(
        absl::StrCat(Count(copies, "triangle repeats", "triangles repeat"),
                     " another one on the same three vertices that faces the same way. The copies "
                     "get targets twice; remove them in the CAD program."));
  }
  if (health.degenerate_triangle_count > 0) {
    findings.push_back(
        absl::StrCat(Count(health.degenerate_triangle_count, "triangle has", "triangles have"),
                     " no area. They are no part of the surface."));
  }
  if (enclosed_components > 0) {
    findings.push_back(absl::StrCat(
        Count(enclosed_components, "closed component lies", "closed components lie"),
        " wholly inside another one (closed inner cavities or parts): no camera sees them, their "
        "targets count as not measurable."));
  }
  if (nesting_steps > kMostNestingSteps) {
    findings.push_back(absl::StrCat(
        "The part has ", health.component_count,
        " components, too many within each other to find out which are inside out or enclosed."));
  }
  return health;
}

}  // namespace sightline
