// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/view/render_view.h"

#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/ext/matrix_clip_space.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <limits>
#include <nanoflann.hpp>
#include <numbers>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/rig/scan_geometry.h"
#include "core/status/status_macros.h"
#include "coverage_server/gl/gl_context.h"

namespace sightline {
namespace {

constexpr char kViewVertexShader[] = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 colour;
uniform mat4 to_clip;
out vec3 place;
out vec4 shade_colour;
void main() {
  gl_Position = to_clip * vec4(position, 1);
  place = position;
  shade_colour = colour;
}
)";
// Light from the viewer and a little from above. Facets are flat: the normal towards the viewer
// follows from how the place changes across the image.
constexpr char kViewFragmentShader[] = R"(#version 330 core
in vec3 place;
in vec4 shade_colour;
uniform vec3 to_viewer;
uniform float shading;
out vec4 pixel;
void main() {
  vec3 normal = cross(dFdx(place), dFdy(place));
  normal /= max(length(normal), 1e-20);
  float light = 0.3 + 0.6 * abs(dot(normal, to_viewer)) + 0.1 * normal.z;
  pixel = vec4(shade_colour.rgb * mix(1.0, light, shading), shade_colour.a);
}
)";

using Colour = Eigen::Vector4f;
const Colour kPartColour(0.72f, 0.74f, 0.77f, 1);
const Colour kCoveredColour(0.36f, 0.20f, 0.56f, 1);
const Colour kUncoveredColour(0.96f, 0.82f, 0.24f, 1);
const Colour kUnmeasurableColour(0.87f, 0.37f, 0.20f, 1);
const Colour kMeasurableColour(0.42f, 0.62f, 0.78f, 1);
const Colour kCameraColour(0.20f, 0.40f, 0.80f, 1);
const Colour kLaserColour(0.25f, 0.25f, 0.28f, 1);
const Colour kFanColour(1.0f, 0.15f, 0.10f, 0.28f);
const Colour kLineColour(1.0f, 0.05f, 0.05f, 1);
const Colour kObstacleColour(0.55f, 0.50f, 0.42f, 1);

struct Vertex {
  float position[3];
  uint8_t colour[4];
};

class DrawList {
 public:
  uint32_t Add(const Eigen::Vector3f& p, const Colour& c) {
    Vertex vertex{{p.x(), p.y(), p.z()}, {}};
    for (int k = 0; k < 4; ++k) {
      vertex.colour[k] = static_cast<uint8_t>(std::lround(255 * std::clamp(c[k], 0.0f, 1.0f)));
    }
    vertices_.push_back(vertex);
    return static_cast<uint32_t>(vertices_.size() - 1);
  }
  // Adds a triangle of vertices that were added before.
  void Triangle(uint32_t a, uint32_t b, uint32_t c) { indices_.insert(indices_.end(), {a, b, c}); }
  void Triangle(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                const Colour& colour) {
    Triangle(Add(a, colour), Add(b, colour), Add(c, colour));
  }
  void Quad(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
            const Eigen::Vector3f& d, const Colour& colour) {
    Triangle(a, b, c, colour);
    Triangle(a, c, d, colour);
  }
  // Parallelepiped centre +- x +- y +- z.
  void Box(const Eigen::Vector3f& centre, const Eigen::Vector3f& x, const Eigen::Vector3f& y,
           const Eigen::Vector3f& z, const Colour& colour) {
    for (const float s : {-1.0f, 1.0f}) {
      Quad(centre + s * x - y - z, centre + s * x + y - z, centre + s * x + y + z,
           centre + s * x - y + z, colour);
      Quad(centre + s * y - x - z, centre + s * y + x - z, centre + s * y + x + z,
           centre + s * y - x + z, colour);
      Quad(centre + s * z - x - y, centre + s * z + x - y, centre + s * z + x + y,
           centre + s * z - x + y, colour);
    }
  }
  void Rod(const Eigen::Vector3f& a, const Eigen::Vector3f& b, float radius, const Colour& colour) {
    const Eigen::Vector3f axis = b - a;
    const Eigen::Vector3f x =
        axis.cross(std::abs(axis.x()) < 0.7f * axis.norm() ? Eigen::Vector3f::UnitX()
                                                           : Eigen::Vector3f::UnitY())
            .normalized() *
        radius;
    Box(0.5f * (a + b), x, axis.cross(x).normalized() * radius, 0.5f * axis, colour);
  }
  const std::vector<Vertex>& vertices() const { return vertices_; }
  const std::vector<uint32_t>& indices() const { return indices_; }
  void Reserve(size_t vertices, size_t triangles) {
    vertices_.reserve(vertices);
    indices_.reserve(3 * triangles);
  }

 private:
  std::vector<Vertex> vertices_;
  std::vector<uint32_t> indices_;
};

struct PointCloud {
  std::vector<Eigen::Vector3f> points;
  size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(size_t i, size_t axis) const {
    return points[i][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointCloud>,
                                                   PointCloud, 3>;

// Distance to the nearest of the points, if one is nearer than `reach_m`; else infinite.
class NearestDistance {
 public:
  explicit NearestDistance(std::vector<Eigen::Vector3f> points,
                           float reach_m = std::numeric_limits<float>::infinity())
      : reach_squared_(reach_m * reach_m),
        cloud_{std::move(points)},
        tree_(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {
    if (!cloud_.points.empty()) tree_.buildIndex();
  }
  float operator()(const Eigen::Vector3f& p) const {
    constexpr float kFar = std::numeric_limits<float>::infinity();
    if (cloud_.points.empty()) return kFar;
    size_t index = 0;
    float squared = 0;
    nanoflann::KNNResultSet<float> result(1);
    result.init(&index, &squared);
    squared = reach_squared_;  // farther points are ignored
    tree_.findNeighbors(result, p.data(), nanoflann::SearchParams());
    return result.size() > 0 ? std::sqrt(squared) : kFar;
  }

 private:
  float reach_squared_;
  PointCloud cloud_;
  KdTree tree_;
};

// A mesh whose triangles were split until edges are at most `edge_m`, so that colours given at its
// vertices follow a pattern of that size.
TriangleMesh Split(const TriangleMesh& mesh, float edge_m) {
  TriangleMesh fine;
  fine.positions_m = mesh.positions_m;
  fine.triangles.reserve(mesh.triangles.size());
  struct Piece {
    std::array<uint32_t, 3> corners;
    int depth;
  };
  constexpr int kMostDepth = 16;
  std::vector<Piece> waiting;
  for (const auto& triangle : mesh.triangles) {
    waiting.push_back({triangle, 0});
    while (!waiting.empty()) {
      const Piece piece = waiting.back();
      waiting.pop_back();
      // Halving the longest edge keeps the long thin triangles of CAD meshes to few pieces.
      int longest = 0;
      float longest_squared = 0;
      for (int k = 0; k < 3; ++k) {
        const float squared =
            (fine.positions_m[piece.corners[k]] - fine.positions_m[piece.corners[(k + 1) % 3]])
                .squaredNorm();
        if (squared <= longest_squared) continue;
        longest_squared = squared;
        longest = k;
      }
      if (longest_squared <= edge_m * edge_m || piece.depth >= kMostDepth) {
        fine.triangles.push_back(piece.corners);
        continue;
      }
      const uint32_t a = piece.corners[longest], b = piece.corners[(longest + 1) % 3],
                     c = piece.corners[(longest + 2) % 3];
      const auto middle = static_cast<uint32_t>(fine.positions_m.size());
      const Eigen::Vector3f between = 0.5f * (fine.positions_m[a] + fine.positions_m[b]);
      fine.positions_m.push_back(between);
      waiting.push_back({{a, middle, c}, piece.depth + 1});
      waiting.push_back({{middle, b, c}, piece.depth + 1});
    }
  }
  return fine;
}

// Adds a mesh: colour_at(vertex) in the mesh's coordinates, place(vertex) in those of the picture.
template <typename ColourAt, typename Place>
void AddMesh(const TriangleMesh& mesh, const ColourAt& colour_at, const Place& place,
             DrawList& list) {
  list.Reserve(list.vertices().size() + mesh.positions_m.size(),
               list.indices().size() / 3 + mesh.triangles.size());
  const auto first = static_cast<uint32_t>(list.vertices().size());
  for (const Eigen::Vector3f& p : mesh.positions_m) list.Add(place(p), colour_at(p));
  for (const auto& t : mesh.triangles) list.Triangle(first + t[0], first + t[1], first + t[2]);
}

void AddBodies(const std::vector<Body>& bodies, const SensorPose& pose, const Colour& colour,
               DrawList& list) {
  const Eigen::Vector3f x = pose.x_axis.cast<float>(), y = pose.y_axis.cast<float>(),
                        z = pose.z_axis.cast<float>();
  for (const Body& body : bodies) {
    const Eigen::Vector3d c = std::visit([](const auto& b) { return b.centre_m; }, body);
    const Eigen::Vector3f centre =
        (pose.origin_m + c.x() * pose.x_axis + c.y() * pose.y_axis + c.z() * pose.z_axis)
            .cast<float>();
    if (const auto* box = std::get_if<BoxBody>(&body)) {
      const Eigen::Vector3f half = 0.5f * box->size_m.cast<float>();
      list.Box(centre, half.x() * x, half.y() * y, half.z() * z, colour);
    } else {
      const auto& cylinder = std::get<CylinderBody>(body);
      const float r = static_cast<float>(cylinder.radius_m),
                  h = 0.5f * static_cast<float>(cylinder.length_m);
      constexpr int kSides = 32;
      for (int k = 0; k < kSides; ++k) {
        const float a0 = 2 * std::numbers::pi_v<float> * static_cast<float>(k) / kSides;
        const float a1 = 2 * std::numbers::pi_v<float> * static_cast<float>(k + 1) / kSides;
        const Eigen::Vector3f p = r * (std::cos(a0) * x + std::sin(a0) * y),
                              q = r * (std::cos(a1) * x + std::sin(a1) * y);
        list.Quad(centre + p - h * z, centre + q - h * z, centre + q + h * z, centre + p + h * z,
                  colour);
        for (const float end : {-h, h}) {
          list.Triangle(centre + end * z, centre + p + end * z, centre + q + end * z, colour);
        }
      }
    }
  }
}

// Transformation from the frame of `pose` to the clip cube of a pinhole camera at `pose`, whose
// image extends to the tangents `tan_x` and `tan_y`. A sensor looks along +z with rows growing
// along +y, an OpenGL eye along -z with +y up.
glm::mat4 ToClip(const SensorPose& pose, double tan_x, double tan_y, double near_m, double far_m) {
  const Eigen::Matrix4d from_sensor = pose.Matrix();
  const glm::dmat4 to_sensor = glm::inverse(glm::make_mat4(from_sensor.data()));
  const glm::dmat4 to_eye = glm::scale(glm::dmat4(1), glm::dvec3(1, -1, -1)) * to_sensor;
  return glm::frustum(-tan_x * near_m, tan_x * near_m, -tan_y * near_m, tan_y * near_m, near_m,
                      far_m) *
         to_eye;
}

absl::StatusOr<std::string> Rasterize(const DrawList& opaque, const DrawList& translucent,
                                      const glm::mat4& to_clip, const Eigen::Vector3f& to_viewer,
                                      int columns, int rows) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto context, MakeOffscreenContext());
  const GlFunctions& gl = context->gl();
  constexpr int kSamples = 2;  // per axis; averaged below
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto framebuffer,
      Framebuffer::Make(gl, kSamples * columns, kSamples * rows, /*with_colour=*/true));
  SIGHTLINE_ASSIGN_OR_RETURN(auto program, MakeProgram(gl, kViewVertexShader, kViewFragmentShader));
  gl.Viewport(0, 0, kSamples * columns, kSamples * rows);
  gl.ClearColor(1, 1, 1, 1);
  gl.ClearDepth(1);
  gl.Clear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  gl.Enable(GL_DEPTH_TEST);
  gl.DepthFunc(GL_LESS);
  gl.UseProgram(program);
  gl.UniformMatrix4fv(gl.GetUniformLocation(program, "to_clip"), 1, GL_FALSE,
                      glm::value_ptr(to_clip));
  gl.Uniform3f(gl.GetUniformLocation(program, "to_viewer"), to_viewer.x(), to_viewer.y(),
               to_viewer.z());
  const GLint shading = gl.GetUniformLocation(program, "shading");
  GLuint array, buffers[2];
  gl.GenVertexArrays(1, &array);
  gl.BindVertexArray(array);
  gl.GenBuffers(2, buffers);
  gl.BindBuffer(GL_ARRAY_BUFFER, buffers[0]);
  gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, buffers[1]);
  for (const DrawList* list : {&opaque, &translucent}) {
    const auto& v = list->vertices();
    const auto& indices = list->indices();
    if (indices.empty()) continue;
    gl.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(v.size() * sizeof(Vertex)), v.data(),
                  GL_STREAM_DRAW);
    gl.BufferData(GL_ELEMENT_ARRAY_BUFFER,
                  static_cast<GLsizeiptr>(indices.size() * sizeof(uint32_t)), indices.data(),
                  GL_STREAM_DRAW);
    static_assert(offsetof(Vertex, position) == 0);
    gl.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex), nullptr);
    // OpenGL takes the offset in the buffer as a pointer.
    // NOLINTNEXTLINE(performance-no-int-to-ptr)
    const auto* const at_colour = reinterpret_cast<const void*>(offsetof(Vertex, colour));
    gl.VertexAttribPointer(1, 4, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(Vertex), at_colour);
    for (GLuint k = 0; k < 2; ++k) gl.EnableVertexAttribArray(k);
    gl.Uniform1f(shading, list == &opaque ? 1.0f : 0.0f);
    if (list == &translucent) {
      gl.Enable(GL_BLEND);
      gl.BlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
      gl.DepthMask(GL_FALSE);
    }
    gl.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(indices.size()), GL_UNSIGNED_INT, nullptr);
  }
  std::vector<uint8_t> fine(static_cast<size_t>(kSamples * columns) * kSamples * rows * 4);
  gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl.ReadPixels(0, 0, kSamples * columns, kSamples * rows, GL_RGBA, GL_UNSIGNED_BYTE, fine.data());
  if (gl.GetError() != GL_NO_ERROR)
    return absl::InternalError("OpenGL error while rendering a view");

  std::vector<uint8_t> image(static_cast<size_t>(columns) * rows * 3);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      for (int channel = 0; channel < 3; ++channel) {
        int sum = 0;
        for (int i = 0; i < kSamples; ++i) {
          for (int j = 0; j < kSamples; ++j) {
            const size_t fine_row =
                static_cast<size_t>(kSamples) * (rows - 1 - row) + i;  // GL is bottom-up
            const size_t fine_column = static_cast<size_t>(kSamples) * column + j;
            sum += fine[(fine_row * kSamples * columns + fine_column) * 4 + channel];
          }
        }
        image[(static_cast<size_t>(row) * columns + column) * 3 + channel] =
            static_cast<uint8_t>(sum / (kSamples * kSamples));
      }
    }
  }
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(columns);
  png.height = static_cast<png_uint_32>(rows);
  png.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = 0;
  if (!png_image_write_get_memory_size(png, size, 0, image.data(), 0, nullptr)) {
    return absl::InternalError(absl::StrCat("cannot encode PNG: ", png.message));
  }
  std::string bytes(size, '\0');
  if (!png_image_write_to_memory(&png, bytes.data(), &size, 0, image.data(), 0, nullptr)) {
    return absl::InternalError(absl::StrCat("cannot encode PNG: ", png.message));
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace

absl::StatusOr<std::string> RenderView(const CoverageScene& scene, const ViewRequest& request) {
  for (const int size : {request.columns_px, request.rows_px}) {
    if (size < 16 || size > 4096) {
      return absl::InvalidArgumentError(absl::StrCat("image size ", request.columns_px, "x",
                                                     request.rows_px, " is outside [16, 4096]"));
    }
  }
  if (request.kind == ViewKind::kCamera && !request.measurement) {
    return absl::InvalidArgumentError("the camera view needs a measurement");
  }
  const bool in_world = request.measurement.has_value() && request.kind != ViewKind::kCoverage &&
                        request.kind != ViewKind::kMeasurability;
  ScanGeometry geometry;
  if (in_world) geometry = MakeScanGeometry(scene.rig(), *request.measurement);
  const Eigen::Vector3d part_centre = scene.part_centre_m();
  const auto place = [&](const Eigen::Vector3f& p) -> Eigen::Vector3f {
    return in_world
               ? PartToWorld(geometry, part_centre, p.cast<double>(), request.stage_m).cast<float>()
               : p;
  };

  // Colours of the part.
  const TargetSet& targets = scene.targets();
  const bool by_coverage = request.covered.size() == targets.size() && request.covered.size() > 0 &&
                           request.kind != ViewKind::kMeasurability;
  const bool coloured = by_coverage || request.kind == ViewKind::kMeasurability ||
                        request.kind == ViewKind::kCoverage;
  const bool measurability = request.kind == ViewKind::kMeasurability;
  std::vector<Eigen::Vector3f> yes, no;
  for (size_t t = 0; t < targets.size() && coloured; ++t) {
    const bool set =
        measurability ? scene.measurable().Test(t) : by_coverage && request.covered.Test(t);
    if (set) yes.push_back(targets.positions_m[t]);
    if (!set && measurability) no.push_back(targets.positions_m[t]);
  }
  // Purple within 3 mm of a measured target, yellow beyond 15 mm (as thesis Table 6.4).
  constexpr float kPurpleM = 0.003f, kYellowM = 0.015f;
  const NearestDistance to_yes(std::move(yes),
                               measurability ? std::numeric_limits<float>::infinity() : kYellowM);
  const NearestDistance to_no(std::move(no));
  const auto colour_at = [&](const Eigen::Vector3f& p) -> Colour {
    if (!coloured) return kPartColour;
    if (measurability) return to_yes(p) <= to_no(p) ? kMeasurableColour : kUnmeasurableColour;
    const float mix = std::clamp((to_yes(p) - kPurpleM) / (kYellowM - kPurpleM), 0.0f, 1.0f);
    return (1 - mix) * kCoveredColour + mix * kUncoveredColour;
  };
  const Eigen::AlignedBox3d box = scene.part().BoundingBox();
  const double diagonal = box.sizes().norm();
  DrawList opaque, translucent;
  if (coloured) {
    const auto pattern_m = static_cast<float>(std::max(0.004, diagonal / 200));
    AddMesh(Split(scene.part(), pattern_m), colour_at, place, opaque);
  } else {
    AddMesh(scene.part(), colour_at, place, opaque);
  }
  for (const SceneObstacle& obstacle : scene.obstacles()) {
    if (!in_world && obstacle.frame != ObstacleFrame::kPart) continue;
    const auto place_obstacle = [&](const Eigen::Vector3f& p) -> Eigen::Vector3f {
      if (obstacle.frame == ObstacleFrame::kPart) return place(p);
      if (obstacle.frame == ObstacleFrame::kWorld) return p;
      const double lift_m = obstacle.frame == ObstacleFrame::kTable ? geometry.table_height_m : 0.0;
      return p +
             (geometry.part_offset_m + Eigen::Vector3d(request.stage_m, 0, lift_m)).cast<float>();
    };
    AddMesh(
        obstacle.mesh, [](const auto&) { return kObstacleColour; }, place_obstacle, opaque);
  }

  if (in_world && request.measurement) {
    // The laser line as measured in this frame.
    std::vector<MeasurementPoint> points;
    scene.EvaluateExact(*request.measurement, &points, nullptr);
    const int frame = static_cast<int>(std::lround(request.stage_m / scene.rig().scan_step_m));
    const float size = static_cast<float>(
        request.kind == ViewKind::kCamera ? 0.0008 : 0.003 * std::max(diagonal, 0.05));
    for (const MeasurementPoint& p : points) {
      if (p.frame != frame) continue;
      const Eigen::Vector3f centre = place(p.position_m);
      opaque.Box(centre, size * Eigen::Vector3f::UnitX(), size * Eigen::Vector3f::UnitY(),
                 size * Eigen::Vector3f::UnitZ(), kLineColour);
    }
  }

  SensorPose eye;
  double tan_x, tan_y, near_m, far_m;
  if (request.kind == ViewKind::kCamera) {
    eye = geometry.camera;
    const Camera& camera = scene.rig().camera;
    tan_x = 0.5 * camera.columns_px / camera.FocalLengthPx();
    tan_y = 0.5 * camera.rows_px / camera.FocalLengthPx();
    near_m = 0.005;
    far_m = 5 + diagonal;
  } else {
    Eigen::AlignedBox3d all;
    for (int corner = 0; corner < 8; ++corner) {
      all.extend(
          place(box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)).cast<float>())
              .cast<double>());
    }
    const Eigen::AlignedBox3d part_bounds = all;
    if (in_world) {
      AddBodies(scene.rig().camera_bodies, geometry.camera, kCameraColour, opaque);
      AddBodies(scene.rig().laser_bodies, geometry.laser, kLaserColour, opaque);
      const SensorPose& laser = geometry.laser;
      // The fan reaches as far as the rig's origin needs.
      const double length = laser.origin_m.norm() + 0.5 * diagonal;
      const double half =
          std::min(std::tan(0.5 * scene.rig().laser.fan_angle_rad) * length, 0.5 * diagonal + 0.05);
      const Eigen::Vector3f source = laser.origin_m.cast<float>();
      const Eigen::Vector3f a =
          (laser.origin_m + length * laser.z_axis - half * laser.x_axis).cast<float>();
      const Eigen::Vector3f b =
          (laser.origin_m + length * laser.z_axis + half * laser.x_axis).cast<float>();
      translucent.Triangle(source, a, b, kFanColour);
      const float axis = 0.25f * static_cast<float>(diagonal),
                  rod = 0.004f * static_cast<float>(diagonal);
      opaque.Rod(Eigen::Vector3f::Zero(), axis * Eigen::Vector3f::UnitX(), rod,
                 Colour(0.85f, 0.1f, 0.1f, 1));
      opaque.Rod(Eigen::Vector3f::Zero(), axis * Eigen::Vector3f::UnitY(), rod,
                 Colour(0.1f, 0.65f, 0.1f, 1));
      opaque.Rod(Eigen::Vector3f::Zero(), axis * Eigen::Vector3f::UnitZ(), rod,
                 Colour(0.1f, 0.2f, 0.85f, 1));
      all.extend(geometry.camera.origin_m - 0.1 * geometry.camera.z_axis);
      all.extend(geometry.laser.origin_m - 0.1 * geometry.laser.z_axis);
    }
    // With a stated distance the view is centred on the part, without the sensors.
    const Eigen::Vector3d centre = request.distance_m > 0 ? part_bounds.center() : all.center();
    const double radius = 0.5 * all.sizes().norm();
    tan_y = std::tan(0.5 * 30 * std::numbers::pi / 180);
    tan_x = tan_y * request.columns_px / request.rows_px;
    const double distance =
        request.distance_m > 0 ? request.distance_m : 0.92 * radius / std::min(tan_x, tan_y);
    const double ce = std::cos(request.elevation_rad), se = std::sin(request.elevation_rad);
    const Eigen::Vector3d direction(ce * std::cos(request.azimuth_rad),
                                    ce * std::sin(request.azimuth_rad), se);
    eye.origin_m = centre + distance * direction;
    eye.z_axis = -direction;
    eye.x_axis = Eigen::Vector3d(-std::sin(request.azimuth_rad), std::cos(request.azimuth_rad), 0);
    eye.y_axis = eye.z_axis.cross(eye.x_axis);
    near_m = std::max(0.01 * distance, distance - 3 * radius);
    far_m = distance + 3 * radius;
  }
  return Rasterize(opaque, translucent, ToClip(eye, tan_x, tan_y, near_m, far_m),
                   (-eye.z_axis).cast<float>(), request.columns_px, request.rows_px);
}

}  // namespace sightline
