// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/visibility/field_renderer.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/ext/matrix_transform.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <vector>

#include "core/cpu/function_clones.h"
#include "core/part/surface_geometry.h"
#include "core/status/status_macros.h"
#include "coverage_server/gl/gl_context.h"
#include "coverage_server/occlusion/occluder_mesh.h"
#include "coverage_server/visibility/octahedral_map.h"
#include "coverage_server/visibility/visibility_field.h"

namespace sightline {
namespace {

constexpr char kDepthVertexShader[] = R"(#version 330 core
layout(location = 0) in vec3 position;
uniform mat4 to_clip;
void main() { gl_Position = to_clip * vec4(position, 1); }
)";
constexpr char kDepthFragmentShader[] = R"(#version 330 core
void main() {}
)";

// Orthographic view from infinity along -direction: pixel = (axis . x - origin) / pixel size,
// depth in [0, 1] growing away from the viewer.
struct OrthographicView {
  Eigen::Vector3f u, v, w;
  float u0, v0, near_w, depth_range, inverse_pixel;
  int columns, rows;

  static OrthographicView Make(const FieldJob& job, const Eigen::Vector3f& direction) {
    OrthographicView view;
    view.w = direction;
    const auto axes = TangentAxes(direction);
    view.u = axes[0];
    view.v = axes[1];
    Eigen::Vector3f low = Eigen::Vector3f::Constant(1e30f), high = -low;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3f x(corner & 1 ? job.box_max[0] : job.box_min[0],
                              corner & 2 ? job.box_max[1] : job.box_min[1],
                              corner & 4 ? job.box_max[2] : job.box_min[2]);
      const Eigen::Vector3f projected(view.u.dot(x), view.v.dot(x), view.w.dot(x));
      low = low.cwiseMin(projected);
      high = high.cwiseMax(projected);
    }
    const float pixel = job.pixel_size_m;
    view.u0 = low.x() - pixel;
    view.v0 = low.y() - pixel;
    view.near_w = high.z() + 2 * pixel;
    view.depth_range = high.z() - low.z() + 4 * pixel;
    view.inverse_pixel = 1 / pixel;
    view.columns = static_cast<int>((high.x() - low.x()) / pixel) + 3;
    view.rows = static_cast<int>((high.y() - low.y()) / pixel) + 3;
    return view;
  }

  // From part coordinates to OpenGL's clip cube.
  glm::mat4 ToClip() const {
    const glm::mat4 axes = glm::transpose(glm::mat4(
        glm::mat3(glm::make_vec3(u.data()), glm::make_vec3(v.data()), -glm::make_vec3(w.data()))));
    const glm::vec3 scale(2 * inverse_pixel / static_cast<float>(columns),
                          2 * inverse_pixel / static_cast<float>(rows), 2 / depth_range);
    const glm::mat4 identity(1);
    return glm::translate(identity, glm::vec3(-1)) * glm::scale(identity, scale) *
           glm::translate(identity, glm::vec3(-u0, -v0, near_w)) * axes;
  }
};

// Number of bits of depth tests: out[t] gets bit k set if probe k of target t is seen.
SIGHTLINE_CLONES("avx512f", "avx2")
void TestProbes(const float* __restrict x, const float* __restrict y, const float* __restrict z,
                const float* __restrict nx, const float* __restrict ny, const float* __restrict nz,
                size_t count, int bit, const OrthographicView& view, const float* __restrict depth,
                float pixel, int32_t* __restrict out) {
  // A probe is pushed off its surface along the normal and towards the viewer, by more where the
  // surface is steep: a depth pixel spans 0.5 px tan(theta) of depth to either side.
  constexpr float kNormalPushPx = 0.2f, kNormalPushM = 5e-5f, kViewPushPx = 0.1f,
                  kSlopePushPx = 0.5f, kMaxSlope = 20;
  const float ux = view.u.x(), uy = view.u.y(), uz = view.u.z();
  const float vx = view.v.x(), vy = view.v.y(), vz = view.v.z();
  const float wx = view.w.x(), wy = view.w.y(), wz = view.w.z();
  const float push = kNormalPushPx * pixel + kNormalPushM;
  const float u0 = view.u0, v0 = view.v0, inverse_pixel = view.inverse_pixel;
  const float near_w = view.near_w, inverse_range = 1 / view.depth_range;
  const int columns = view.columns;
  const float max_u = static_cast<float>(view.columns - 1),
              max_v = static_cast<float>(view.rows - 1);
  for (size_t t = 0; t < count; ++t) {
    const float facing = nx[t] * wx + ny[t] * wy + nz[t] * wz;
    const float cosine = std::max(facing, 0.01f);
    const float slope =
        std::min(std::sqrt(std::max(1 - cosine * cosine, 0.0f)) / cosine, kMaxSlope);
    const float px = x[t] + push * nx[t], py = y[t] + push * ny[t], pz = z[t] + push * nz[t];
    const float a = (ux * px + uy * py + uz * pz - u0) * inverse_pixel;
    const float b = (vx * px + vy * py + vz * pz - v0) * inverse_pixel;
    const int i = static_cast<int>(std::min(std::max(a, 0.0f), max_u));
    const int j = static_cast<int>(std::min(std::max(b, 0.0f), max_v));
    const float c =
        (near_w - (wx * px + wy * py + wz * pz) - (kViewPushPx + kSlopePushPx * slope) * pixel) *
        inverse_range;
    const int seen = (facing > 0) & (c <= depth[j * columns + i]);
    out[t] |= seen << bit;
  }
}

class TileRenderer {
 public:
  TileRenderer(FieldJob& job, uint8_t* field) : job_(job), field_(field) {}

  absl::Status Init() {
    SIGHTLINE_ASSIGN_OR_RETURN(context_, MakeOffscreenContext());
    const GlFunctions& gl = context_->gl();
    Eigen::Vector3f size;
    for (int k = 0; k < 3; ++k) size[k] = job_.box_max[k] - job_.box_min[k];
    const int side = static_cast<int>(size.norm() / job_.pixel_size_m) + 4;
    SIGHTLINE_ASSIGN_OR_RETURN(framebuffer_,
                               Framebuffer::Make(gl, side, side, /*with_colour=*/false));
    depth_.resize(static_cast<size_t>(side) * side);
    SIGHTLINE_ASSIGN_OR_RETURN(auto program,
                               MakeProgram(gl, kDepthVertexShader, kDepthFragmentShader));
    gl.UseProgram(program);
    to_clip_ = gl.GetUniformLocation(program, "to_clip");
    GLuint vertex_array, buffers[2];
    gl.GenVertexArrays(1, &vertex_array);
    gl.BindVertexArray(vertex_array);
    gl.GenBuffers(2, buffers);
    gl.BindBuffer(GL_ARRAY_BUFFER, buffers[0]);
    gl.BufferData(GL_ARRAY_BUFFER, GLsizeiptr{12} * job_.vertex_count,
                  job_.At<float>(job_.vertices), GL_STATIC_DRAW);
    gl.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 12, nullptr);
    gl.EnableVertexAttribArray(0);
    gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, buffers[1]);
    gl.Enable(GL_DEPTH_TEST);
    gl.DepthFunc(GL_LESS);
    gl.ClearDepth(1);
    gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
    seen_.resize(job_.target_count);
    return absl::OkStatus();
  }

  absl::Status RenderTile(int tile) {
    const OctahedralMap map{job_.map_side};
    const int tiles_per_side = job_.map_side / kTileSide;
    const int row0 = tile / tiles_per_side * kTileSide, column0 = tile % tiles_per_side * kTileSide;
    seen_clusters_.assign(job_.cluster_count, 1);
    for (int i = 0; i < kTileSide * kTileSide; ++i) {
      // Snake order: every direction is a neighbour of the one before.
      const int r = i / kTileSide, c = r % 2 == 0 ? i % kTileSide : kTileSide - 1 - i % kTileSide;
      const int cell = (row0 + r) * job_.map_side + column0 + c;
      SIGHTLINE_RETURN_IF_ERROR(RenderDirection(cell, map.Direction(cell)));
      job_.directions_done.fetch_add(1, std::memory_order_relaxed);
    }
    return absl::OkStatus();
  }

 private:
  absl::Status RenderDirection(int cell, const Eigen::Vector3f& direction) {
    const GlFunctions& gl = context_->gl();
    const OrthographicView view = OrthographicView::Make(job_, direction);
    gl.Viewport(0, 0, view.columns, view.rows);
    gl.UniformMatrix4fv(to_clip_, 1, GL_FALSE, glm::value_ptr(view.ToClip()));
    gl.Enable(GL_SCISSOR_TEST);
    gl.Scissor(0, 0, view.columns, view.rows);
    gl.Clear(GL_DEPTH_BUFFER_BIT);

    // Coherent occlusion: first the clusters seen from the direction before, then those that the
    // depth image does not hide.
    Draw(direction, [&](uint32_t c) { return seen_clusters_[c] != 0; });
    ReadDepth(view);
    if (job_.coherent_occlusion) {
      newly_seen_.assign(job_.cluster_count, 0);
      bool any = false;
      for (uint32_t c = 0; c < job_.cluster_count; ++c) {
        if (FacesAway(c, direction)) {
          seen_clusters_[c] = 0;
          continue;
        }
        const bool visible = ClusterVisible(c, view);
        if (visible && !seen_clusters_[c]) newly_seen_[c] = 1, any = true;
        seen_clusters_[c] = visible;
      }
      if (any) {
        Draw(direction, [&](uint32_t c) { return newly_seen_[c] != 0; });
        ReadDepth(view);
      }
    }
    if (const GLenum error = gl.GetError(); error != GL_NO_ERROR) {
      return absl::InternalError("OpenGL error while rendering the visibility field");
    }

    std::fill(seen_.begin(), seen_.end(), 0);
    const size_t n = job_.target_count, stride = n * kProbesPerTarget;
    const float* p = job_.At<float>(job_.probes);
    for (int k = 0; k < kProbesPerTarget; ++k) {
      const float* q = p + k * n;
      TestProbes(q, q + stride, q + 2 * stride, q + 3 * stride, q + 4 * stride, q + 5 * stride, n,
                 k, view, depth_.data(), job_.pixel_size_m, seen_.data());
    }
    const size_t cells = static_cast<size_t>(job_.map_side) * job_.map_side;
    for (size_t block = 0; block < n / kTargetsPerBlock; ++block) {
      uint8_t* row = field_ + (block * cells + cell) * kTargetsPerBlock;
      for (int t = 0; t < kTargetsPerBlock; ++t) {
        row[t] = static_cast<uint8_t>(seen_[block * kTargetsPerBlock + t]);
      }
    }
    return absl::OkStatus();
  }

  bool FacesAway(uint32_t cluster, const Eigen::Vector3f& d) const {
    if (!job_.cull_back_faces) return false;
    const OccluderCluster& c = job_.At<OccluderCluster>(job_.clusters)[cluster];
    return -(c.cone_axis[0] * d.x() + c.cone_axis[1] * d.y() + c.cone_axis[2] * d.z()) >=
           c.cone_cutoff;
  }

  template <typename Wanted>
  void Draw(const Eigen::Vector3f& d, Wanted wanted) {
    const GlFunctions& gl = context_->gl();
    const auto* clusters = job_.At<OccluderCluster>(job_.clusters);
    const auto* triangles = job_.At<uint32_t>(job_.triangles);
    const auto* normals = job_.At<float>(job_.triangle_normals);
    indices_.clear();
    for (uint32_t c = 0; c < job_.cluster_count; ++c) {
      if (!wanted(c) || FacesAway(c, d)) continue;
      const uint32_t end = clusters[c].first_triangle + clusters[c].triangle_count;
      for (size_t t = clusters[c].first_triangle; t < end; ++t) {
        const float* n = normals + 3 * t;
        if (job_.cull_back_faces && n[0] * d.x() + n[1] * d.y() + n[2] * d.z() <= 0) continue;
        indices_.insert(indices_.end(), triangles + 3 * t, triangles + 3 * t + 3);
      }
    }
    if (indices_.empty()) return;
    gl.BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(indices_.size() * 4),
                  indices_.data(), GL_STREAM_DRAW);
    gl.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(indices_.size()), GL_UNSIGNED_INT, nullptr);
  }

  void ReadDepth(const OrthographicView& view) {
    context_->gl().ReadPixels(0, 0, view.columns, view.rows, GL_DEPTH_COMPONENT, GL_FLOAT,
                              depth_.data());
  }

  bool ClusterVisible(uint32_t cluster, const OrthographicView& view) const {
    const OccluderCluster& c = job_.At<OccluderCluster>(job_.clusters)[cluster];
    const float* vertices = job_.At<float>(job_.cluster_vertices) + size_t{3} * c.first_vertex;
    const float slack = 1.5f * job_.pixel_size_m / view.depth_range;
    for (size_t i = 0; i < c.vertex_count; ++i) {
      const Eigen::Vector3f x(vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]);
      const int a = std::clamp(static_cast<int>((view.u.dot(x) - view.u0) * view.inverse_pixel), 0,
                               view.columns - 1);
      const int b = std::clamp(static_cast<int>((view.v.dot(x) - view.v0) * view.inverse_pixel), 0,
                               view.rows - 1);
      const float depth = (view.near_w - view.w.dot(x)) / view.depth_range;
      if (depth <= depth_[static_cast<size_t>(b) * view.columns + a] + slack) return true;
    }
    return false;
  }

  FieldJob& job_;
  uint8_t* field_;
  std::unique_ptr<GlContext> context_;
  std::unique_ptr<Framebuffer> framebuffer_;
  GLint to_clip_ = -1;
  std::vector<float> depth_;
  std::vector<uint32_t> indices_;
  std::vector<uint8_t> seen_clusters_, newly_seen_;
  std::vector<int32_t> seen_;
};

}  // namespace

absl::Status RenderFieldTiles(FieldJob& job, uint8_t* field, int32_t number) {
  TileRenderer renderer(job, field);
  SIGHTLINE_RETURN_IF_ERROR(renderer.Init());
  std::atomic<int32_t>* const states = TileStates(job);
  const int tiles = TileCount(job);
  for (int tile = 0; tile < tiles; ++tile) {
    int32_t waiting = kTileWaiting;
    if (!states[tile].compare_exchange_strong(waiting, number)) continue;
    SIGHTLINE_RETURN_IF_ERROR(renderer.RenderTile(tile));
    states[tile].store(kTileDone);
  }
  return absl::OkStatus();
}

}  // namespace sightline
