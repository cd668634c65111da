// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/occlusion/occluder_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/status/status_macros.h"
#include "core/status/stop_check.h"
#include "coverage_server/worker_process/worker_process.h"

namespace sightline {
namespace {

constexpr char kOccluderMeshTask[] = "occluder-mesh";

// The triangles of all meshes, one after the other.
struct Triangles {
  std::vector<float> vertices;
  std::vector<uint32_t> indices;
};

struct Arrays {
  std::vector<float> vertices;
  std::vector<uint32_t> triangles;
  std::vector<float> normals;
  std::vector<OccluderCluster> clusters;
  std::vector<float> cluster_vertices;
  bool closed = true;
};

// Stops early, with an unspecified result, when *cancelled.
Triangles Gather(const TriangleMesh& part, std::span<const TriangleMesh* const> obstacles,
                 const std::atomic<bool>* cancelled) {
  constexpr size_t kPiece = 1 << 18;  // takes some milliseconds
  Triangles all;
  std::vector<const TriangleMesh*> meshes = {&part};
  meshes.insert(meshes.end(), obstacles.begin(), obstacles.end());
  size_t vertices = 0, triangles = 0;
  for (const TriangleMesh* mesh : meshes) {
    vertices += mesh->positions_m.size();
    triangles += mesh->triangles.size();
  }
  // Without it, growing would copy the whole array between two checks of *cancelled.
  all.vertices.reserve(3 * vertices);
  all.indices.reserve(3 * triangles);
  for (const TriangleMesh* mesh : meshes) {
    const auto base = static_cast<uint32_t>(all.vertices.size() / 3);
    for (size_t i = 0; i < mesh->positions_m.size(); ++i) {
      if (i % kPiece == 0 && IsCancelled(cancelled)) return all;
      const Eigen::Vector3f& p = mesh->positions_m[i];
      all.vertices.insert(all.vertices.end(), {p.x(), p.y(), p.z()});
    }
    for (size_t t = 0; t < mesh->triangles.size(); ++t) {
      if (t % kPiece == 0 && IsCancelled(cancelled)) return all;
      for (const uint32_t v : mesh->triangles[t]) all.indices.push_back(base + v);
    }
  }
  return all;
}

// True if every directed edge occurs as often as its opposite. Then back faces hide only places
// that front faces hide too.
bool IsClosed(const std::vector<uint32_t>& indices) {
  std::vector<uint64_t> up, down;
  up.reserve(indices.size() / 2 + 1);
  down.reserve(indices.size() / 2 + 1);
  for (size_t i = 0; i < indices.size(); ++i) {
    const uint32_t a = indices[i], b = indices[i % 3 == 2 ? i - 2 : i + 1];
    if (a < b) {
      up.push_back(uint64_t{a} << 32 | b);
    } else {
      down.push_back(uint64_t{b} << 32 | a);
    }
  }
  if (up.size() != down.size()) return false;
  std::sort(up.begin(), up.end());
  std::sort(down.begin(), down.end());
  return up == down;
}

// Points inside a triangle and on its edges, `spacing_m` apart: the middle of a large triangle may
// be seen while its corners are hidden.
template <typename AddPoint>
void AddInnerPoints(const Eigen::Vector3f* corner, float spacing_m, const AddPoint& add_point) {
  int longest = 0;
  float length = 0;
  for (int k = 0; k < 3; ++k) {
    const float edge = (corner[(k + 1) % 3] - corner[k]).norm();
    if (edge > length) longest = k, length = edge;
  }
  if (length <= spacing_m) return;
  const Eigen::Vector3f a = corner[longest], b = corner[(longest + 1) % 3],
                        apex = corner[(longest + 2) % 3];
  const float height = (b - a).cross(apex - a).norm() / length;
  constexpr int kMaxSteps = 64;
  const int columns = std::min(kMaxSteps, static_cast<int>(std::ceil(length / spacing_m)));
  const int rows = std::min(kMaxSteps, static_cast<int>(std::ceil(height / spacing_m)));
  for (int j = 0; j < rows; ++j) {
    const float up = static_cast<float>(j) / static_cast<float>(rows);
    const int steps =
        std::max(1, static_cast<int>(std::ceil(static_cast<float>(columns) * (1 - up))));
    for (int i = j == 0 ? 1 : 0; i <= steps - (j == 0 ? 1 : 0); ++i) {
      const float along = static_cast<float>(i) / static_cast<float>(steps);
      add_point((1 - up) * (a + along * (b - a)) + up * apex);
    }
  }
}

Arrays Make(Triangles all, double simplification_m, float point_spacing_m) {
  Arrays result;
  result.vertices = std::move(all.vertices);
  std::vector<uint32_t> indices = std::move(all.indices);
  result.closed = IsClosed(indices);
  const size_t vertex_count = result.vertices.size() / 3;
  if (simplification_m > 0 && !indices.empty()) {
    const float scale = meshopt_simplifyScale(result.vertices.data(), vertex_count, 12);
    std::vector<uint32_t> simplified(indices.size());
    simplified.resize(meshopt_simplify(simplified.data(), indices.data(), indices.size(),
                                       result.vertices.data(), vertex_count, 12, 0,
                                       static_cast<float>(simplification_m) / scale, 0, nullptr));
    if (!simplified.empty()) indices = std::move(simplified);
  }
  constexpr size_t kMaxVertices = 64, kMaxTriangles = 32;
  std::vector<meshopt_Meshlet> meshlets(
      meshopt_buildMeshletsBound(indices.size(), kMaxVertices, kMaxTriangles));
  std::vector<uint32_t> meshlet_vertices(meshlets.size() * kMaxVertices);
  std::vector<unsigned char> meshlet_triangles(meshlets.size() * kMaxTriangles * 3);
  meshlets.resize(meshopt_buildMeshlets(
      meshlets.data(), meshlet_vertices.data(), meshlet_triangles.data(), indices.data(),
      indices.size(), result.vertices.data(), vertex_count, 12, kMaxVertices, kMaxTriangles, 0.5f));
  for (const meshopt_Meshlet& m : meshlets) {
    OccluderCluster cluster{};
    cluster.first_triangle = static_cast<uint32_t>(result.triangles.size() / 3);
    cluster.triangle_count = m.triangle_count;
    cluster.first_vertex = static_cast<uint32_t>(result.cluster_vertices.size() / 3);
    const auto add_point = [&](const Eigen::Vector3f& p) {
      result.cluster_vertices.insert(result.cluster_vertices.end(), {p.x(), p.y(), p.z()});
    };
    for (unsigned v = 0; v < m.vertex_count; ++v) {
      add_point(Eigen::Map<const Eigen::Vector3f>(
          &result.vertices[size_t{3} * meshlet_vertices[m.vertex_offset + v]]));
    }
    for (unsigned t = 0; t < m.triangle_count; ++t) {
      Eigen::Vector3f corner[3];
      for (int k = 0; k < 3; ++k) {
        const uint32_t v =
            meshlet_vertices[m.vertex_offset + meshlet_triangles[m.triangle_offset + 3 * t + k]];
        result.triangles.push_back(v);
        corner[k] = Eigen::Map<const Eigen::Vector3f>(&result.vertices[size_t{3} * v]);
      }
      const Eigen::Vector3f n = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
      result.normals.insert(result.normals.end(), {n.x(), n.y(), n.z()});
      AddInnerPoints(corner, point_spacing_m, add_point);
    }
    cluster.vertex_count =
        static_cast<uint32_t>(result.cluster_vertices.size() / 3) - cluster.first_vertex;
    const meshopt_Bounds bounds = meshopt_computeMeshletBounds(
        &meshlet_vertices[m.vertex_offset], &meshlet_triangles[m.triangle_offset], m.triangle_count,
        result.vertices.data(), vertex_count, 12);
    for (int k = 0; k < 3; ++k) cluster.cone_axis[k] = bounds.cone_axis[k];
    cluster.cone_cutoff = bounds.cone_cutoff >= 1 ? 2.0f : bounds.cone_cutoff;
    result.clusters.push_back(cluster);
  }
  return result;
}

OccluderMesh Shown(std::shared_ptr<const Arrays> arrays) {
  OccluderMesh mesh;
  mesh.vertices = arrays->vertices;
  mesh.triangles = arrays->triangles;
  mesh.normals = arrays->normals;
  mesh.clusters = arrays->clusters;
  mesh.cluster_vertices = arrays->cluster_vertices;
  mesh.closed = arrays->closed;
  mesh.storage = std::move(arrays);
  return mesh;
}

}  // namespace

WorkerTask OccluderMeshTask() {
  return {kOccluderMeshTask, [](SharedReader& input, SharedWriter& answer) -> absl::Status {
            const auto simplification_m = input.Get<double>();
            const auto point_spacing_m = input.Get<float>();
            const auto vertices = input.GetAll<float>();
            const auto indices = input.GetAll<uint32_t>();
            if (!input.ok()) return absl::InternalError("the triangles are not whole");
            const Arrays made =
                Make({{vertices.begin(), vertices.end()}, {indices.begin(), indices.end()}},
                     simplification_m, point_spacing_m);
            answer.PutAll(std::span<const float>(made.vertices));
            answer.PutAll(std::span<const uint32_t>(made.triangles));
            answer.PutAll(std::span<const float>(made.normals));
            answer.PutAll(std::span<const OccluderCluster>(made.clusters));
            answer.PutAll(std::span<const float>(made.cluster_vertices));
            answer.Put(made.closed);
            return absl::OkStatus();
          }};
}

absl::StatusOr<OccluderMesh> MakeOccluderMesh(const TriangleMesh& part,
                                              std::span<const TriangleMesh* const> obstacles,
                                              const OccluderOptions& options,
                                              const std::atomic<bool>* cancelled) {
  Triangles all = Gather(part, obstacles, cancelled);
  if (IsCancelled(cancelled)) return absl::CancelledError("occluders");
  const std::string program = WorkerProgram();
  if (program.empty() || all.indices.size() / 3 <= options.most_triangles_here) {
    return Shown(std::make_shared<const Arrays>(
        Make(std::move(all), options.simplification_m, options.point_spacing_m)));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto input, SharedMemory::Make("sightline-occluders", 0));
  SharedWriter writer(input.fd(), cancelled);
  writer.Put(options.simplification_m);
  writer.Put(options.point_spacing_m);
  writer.PutAll(std::span<const float>(all.vertices));
  writer.PutAll(std::span<const uint32_t>(all.indices));
  if (!writer.status().ok()) return writer.status();
  all = {};
  SIGHTLINE_ASSIGN_OR_RETURN(auto answer,
                             RunWorkerTask(program, kOccluderMeshTask, input, cancelled));
  OccluderMesh mesh;
  mesh.vertices = answer.GetAll<float>();
  mesh.triangles = answer.GetAll<uint32_t>();
  mesh.normals = answer.GetAll<float>();
  mesh.clusters = answer.GetAll<OccluderCluster>();
  mesh.cluster_vertices = answer.GetAll<float>();
  mesh.closed = answer.Get<bool>();
  if (!answer.ok()) return absl::InternalError("the occluders are not whole");
  mesh.storage = std::make_shared<const SharedReader>(std::move(answer));
  return mesh;
}

}  // namespace sightline
