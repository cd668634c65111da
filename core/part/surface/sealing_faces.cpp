// SPDX-License-Identifier: Apache-2.0
#include "core/part/surface/sealing_faces.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "core/part/mesh_readers.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

uint64_t UndirectedEdge(const std::array<uint32_t, 3>& corners, size_t k) {
  const uint32_t a = corners[k], b = corners[(k + 1) % 3];
  return uint64_t{std::min(a, b)} << 32 | std::max(a, b);
}

}  // namespace

absl::StatusOr<std::vector<bool>> SealingFaces(std::span<const std::array<uint32_t, 3>> surface,
                                               std::span<const ThinFace> thin,
                                               const StopCheck& stop) {
  std::vector<bool> chosen(thin.size(), false);
  if (thin.empty()) return chosen;

  // The edges that thin faces lie on, each with its thin faces in their order.
  std::vector<std::pair<uint64_t, size_t>> face_on_edge;
  for (size_t i = 0; i < thin.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) {
      if (thin[i].lies_on_edge[k]) {
        face_on_edge.emplace_back(UndirectedEdge(thin[i].corners, k), i);
      }
    }
  }
  std::sort(face_on_edge.begin(), face_on_edge.end());
  std::vector<int64_t> triangles_at(face_on_edge.size(), 0);  // at the first entry of an edge
  const auto first_entry = [&](uint64_t edge) {
    const auto found = std::lower_bound(face_on_edge.begin(), face_on_edge.end(),
                                        std::pair<uint64_t, size_t>(edge, 0));
    return found != face_on_edge.end() && found->first == edge
               ? static_cast<size_t>(found - face_on_edge.begin())
               : face_on_edge.size();
  };
  std::vector<size_t> open;  // faces to look at, since an edge of theirs has one triangle
  size_t steps = 0;
  const auto add = [&](const std::array<uint32_t, 3>& corners, bool look) {
    for (size_t k = 0; k < 3; ++k) {
      const uint64_t edge = UndirectedEdge(corners, k);
      const size_t first = first_entry(edge);
      if (first == face_on_edge.size()) continue;
      if (++triangles_at[first] != 1 || !look) continue;
      for (size_t i = first; i < face_on_edge.size() && face_on_edge[i].first == edge; ++i) {
        open.push_back(face_on_edge[i].second);
      }
    }
    return ++steps % kStepsPerStopCheck == 0 ? CheckStop(stop) : absl::OkStatus();
  };
  for (const auto& triangle : surface) {
    SIGHTLINE_RETURN_IF_ERROR(add(triangle, false));
  }
  for (size_t i = 0; i < thin.size(); ++i) open.push_back(i);
  for (size_t next = 0; next < open.size(); ++next) {
    const size_t i = open[next];
    if (chosen[i]) continue;
    for (size_t k = 0; k < 3 && !chosen[i]; ++k) {
      chosen[i] = thin[i].lies_on_edge[k] &&
                  triangles_at[first_entry(UndirectedEdge(thin[i].corners, k))] == 1;
    }
    if (!chosen[i]) continue;
    SIGHTLINE_RETURN_IF_ERROR(add(thin[i].corners, true));
  }
  return chosen;
}

}  // namespace sightline
