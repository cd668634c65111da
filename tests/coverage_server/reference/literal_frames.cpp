// SPDX-License-Identifier: Apache-2.0
#include "tests/coverage_server/reference/literal_frames.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <glm/ext/matrix_clip_space.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/gtc/type_ptr.hpp>
#define GLM_ENABLE_EXPERIMENTAL
#include <glm/gtx/euler_angles.hpp>
#include <optional>

#include "core/status/status_macros.h"
#include "coverage_server/gl/gl_context.h"

namespace sightline {
namespace {

constexpr char kVertexShader[] = R"(#version 330 core
layout(location = 0) in vec3 position;  // sensor coordinates
uniform mat4 to_clip;
void main() { gl_Position = to_clip * vec4(position, 1); }
)";
// The triangle's number as a colour; 0 is the background.
constexpr char kFragmentShader[] = R"(#version 330 core
out vec4 pixel;
void main() {
  int id = gl_PrimitiveID + 1;
  pixel = vec4(id & 255, (id >> 8) & 255, (id >> 16) & 255, (id >> 24) & 255) / 255.0;
}
)";

struct Sensor {
  Eigen::Vector3d origin, x, y, z;
  Eigen::Vector3d In(const Eigen::Vector3d& p) const {
    const Eigen::Vector3d q = p - origin;
    return {q.dot(x), q.dot(y), q.dot(z)};
  }
};

// ARCHITECTURE of the rig: the sensor stands at (distance, polar, azimuth) and looks at the origin.
Sensor LookingAtOrigin(double distance, double polar, double azimuth) {
  Sensor s;
  s.origin = distance * Eigen::Vector3d(std::sin(polar) * std::cos(azimuth),
                                        std::sin(polar) * std::sin(azimuth), std::cos(polar));
  s.x = Eigen::Vector3d(-std::sin(azimuth), std::cos(azimuth), 0);
  s.z = -s.origin.normalized();
  s.y = s.z.cross(s.x);
  return s;
}

// A depth picture: distance along the viewing axis, 0 where nothing is; and what is seen.
struct Picture {
  int columns = 0, rows = 0;
  double tan_x = 1, tan_y = 1;
  std::vector<double> depth;
  std::vector<uint32_t> triangle;  // 1-based, 0: nothing
  size_t At(int column, int row) const { return static_cast<size_t>(row) * columns + column; }
};

class LiteralScannerImpl final : public LiteralScanner {
 public:
  LiteralScannerImpl(const TriangleMesh& part, const Rig& rig, const Measurement& m, int sub_rows)
      : part_(part), rig_(rig), sub_rows_(sub_rows) {
    camera_ = LookingAtOrigin(m.camera_distance_m, m.camera_polar_rad, m.camera_azimuth_rad);
    laser_ = LookingAtOrigin(rig.laser.distance_m.value_or(m.camera_distance_m),
                             m.camera_polar_rad - m.triangulation_angle_rad, m.camera_azimuth_rad);
    // The sheet holds the source, the origin and the direction along the rows.
    sheet_normal_ = laser_.origin.cross(camera_.x).normalized();
    const glm::dmat4 turn = glm::eulerAngleZYX(m.part_gamma_rad, m.part_beta_rad, m.part_alpha_rad);
    rotation_ = Eigen::Map<const Eigen::Matrix4d>(glm::value_ptr(turn)).topLeftCorner<3, 3>();
    offset_ = Eigen::Vector3d(0, m.offset_y_m, m.offset_z_m);
    centre_ = part.BoundingBox().center();
    radius_ = 0.5 * part.BoundingBox().sizes().norm();
    focal_px_ = 0.5 * rig.camera.rows_px / std::tan(0.5 * rig.camera.vertical_fov_rad);
  }

  absl::Status Init() {
    SIGHTLINE_ASSIGN_OR_RETURN(context_, MakeOffscreenContext());
    const GlFunctions& gl = context_->gl();
    SIGHTLINE_ASSIGN_OR_RETURN(
        camera_buffer_,
        Framebuffer::Make(gl, rig_.camera.columns_px, sub_rows_ * rig_.camera.rows_px, true));
    SIGHTLINE_ASSIGN_OR_RETURN(laser_buffer_, Framebuffer::Make(gl, kLaserSamples, 1, true));
    SIGHTLINE_ASSIGN_OR_RETURN(auto program, MakeProgram(gl, kVertexShader, kFragmentShader));
    gl.UseProgram(program);
    to_clip_ = gl.GetUniformLocation(program, "to_clip");
    GLuint array;
    gl.GenVertexArrays(1, &array);
    gl.BindVertexArray(array);
    GLuint buffers[2];
    gl.GenBuffers(2, buffers);
    gl.BindBuffer(GL_ARRAY_BUFFER, buffers[0]);
    gl.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 12, nullptr);
    gl.EnableVertexAttribArray(0);
    gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, buffers[1]);
    gl.BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(part_.triangles.size() * 12),
                  part_.triangles.data(), GL_STATIC_DRAW);
    gl.Enable(GL_DEPTH_TEST);
    gl.DepthFunc(GL_LESS);
    gl.ClearDepth(1);
    gl.ClearColor(0, 0, 0, 0);
    gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
    return gl.GetError() == GL_NO_ERROR ? absl::OkStatus() : absl::InternalError("OpenGL");
  }

  std::vector<LiteralPoint> Frame(int frame) override {
    stage_m_ = frame * rig_.scan_step_m;
    const auto& c = rig_.camera;
    camera_buffer_->Bind();
    Render(camera_, c.columns_px, sub_rows_ * c.rows_px, 0.5 * c.columns_px / focal_px_,
           0.5 * c.rows_px / focal_px_, seen_);
    // Samples only where the part is: the fan's coordinate of a sphere about the part.
    const Eigen::Vector3d middle = laser_.In(World(centre_));
    const double widest = std::abs(middle.x()) + radius_;
    const double nearest = std::max(middle.z() - radius_, 1e-3);
    const double fan = std::tan(0.5 * rig_.laser.fan_angle_rad);
    laser_buffer_->Bind();
    Render(laser_, kLaserSamples, 1, std::min(fan, widest / nearest), 1e-3, lit_);

    std::vector<LiteralPoint> points;
    for (int column = 0; column < seen_.columns; ++column) {
      for (int row = 0; row + 1 < seen_.rows; ++row) FindCrossing(column, row, points);
    }
    return points;
  }

  bool Undecided(const Eigen::Vector3d& position_m, const Eigen::Vector3d& normal,
                 double grazing_rad) const override {
    const Eigen::Vector3d p = World(position_m), n = rotation_ * normal;
    const double limit = std::sin(grazing_rad);
    if (n.dot((camera_.origin - p).normalized()) < limit) return true;
    if (n.dot((laser_.origin - p).normalized()) < limit) return true;
    // The sheet hardly cuts the surface: where exactly is ill-conditioned.
    if (sheet_normal_.cross(n).norm() < limit) return true;
    const Eigen::Vector3d q = camera_.In(p);
    const double column = focal_px_ * q.x() / q.z() + 0.5 * rig_.camera.columns_px;
    const double row = focal_px_ * q.y() / q.z() + 0.5 * rig_.camera.rows_px;
    const double footprint = q.z() / focal_px_;
    if (row < 1 || row > rig_.camera.rows_px - 1) return true;
    const int c0 = static_cast<int>(std::floor(column));
    const int r0 = static_cast<int>(std::floor(row * sub_rows_));
    for (int c = c0 - 1; c <= c0 + 1; ++c) {
      for (int r = r0 - sub_rows_; r <= r0 + sub_rows_; ++r) {
        if (c < 0 || c >= seen_.columns || r < 0 || r + 1 >= seen_.rows) continue;
        if (!Continuous(seen_, camera_, seen_.At(c, r), seen_.At(c, r + 1), footprint / sub_rows_))
          return true;
        if (c > c0 - 1 && c > 0 &&
            !Continuous(seen_, camera_, seen_.At(c, r), seen_.At(c - 1, r), footprint)) {
          return true;
        }
      }
    }
    const Eigen::Vector3d l = laser_.In(p);
    const double sample = 2 * lit_.tan_x * l.z() / kLaserSamples;
    const double at = (l.x() / l.z() / lit_.tan_x + 1) * 0.5 * kLaserSamples;
    const int reach = static_cast<int>(std::ceil(footprint / sample));
    const int s0 = static_cast<int>(std::floor(at));
    for (int s = std::max(0, s0 - reach); s < std::min(kLaserSamples - 1, s0 + reach); ++s) {
      if (!Continuous(lit_, laser_, s, s + 1, sample)) return true;
    }
    return false;
  }

 private:
  Eigen::Vector3d World(const Eigen::Vector3d& p) const {
    return rotation_ * (p - centre_) + offset_ + Eigen::Vector3d(stage_m_, 0, 0);
  }
  Eigen::Vector3d Normal(uint32_t triangle) const { return rotation_ * part_.Normal(triangle - 1); }

  void Render(const Sensor& sensor, int columns, int rows, double tan_x, double tan_y,
              Picture& picture) {
    const GlFunctions& gl = context_->gl();
    vertices_.clear();
    double nearest = 1e9, farthest = 0;
    for (const auto& x : part_.positions_m) {
      const Eigen::Vector3d p = sensor.In(World(x.cast<double>()));
      nearest = std::min(nearest, p.z());
      farthest = std::max(farthest, p.z());
      vertices_.push_back(p.cast<float>());
    }
    const double near_m = std::max(0.9 * nearest, 1e-3), far_m = std::max(1.1 * farthest, 2e-3);
    gl.Viewport(0, 0, columns, rows);
    gl.Clear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    // The sensor looks along +z, an OpenGL eye along -z; the first row is at the lower border.
    const glm::mat4 to_clip = glm::frustum(-tan_x * near_m, tan_x * near_m, -tan_y * near_m,
                                           tan_y * near_m, near_m, far_m) *
                              glm::scale(glm::dmat4(1), glm::dvec3(1, 1, -1));
    gl.UniformMatrix4fv(to_clip_, 1, GL_FALSE, glm::value_ptr(to_clip));
    gl.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices_.size() * 12), vertices_.data(),
                  GL_STREAM_DRAW);
    gl.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * part_.triangles.size()), GL_UNSIGNED_INT,
                    nullptr);
    const size_t count = static_cast<size_t>(columns) * rows;
    std::vector<float> depth(count);
    std::vector<uint8_t> colour(4 * count);
    gl.ReadPixels(0, 0, columns, rows, GL_DEPTH_COMPONENT, GL_FLOAT, depth.data());
    gl.ReadPixels(0, 0, columns, rows, GL_RGBA, GL_UNSIGNED_BYTE, colour.data());
    picture.columns = columns;
    picture.rows = rows;
    picture.tan_x = tan_x;
    picture.tan_y = tan_y;
    picture.depth.assign(count, 0);
    picture.triangle.assign(count, 0);
    for (size_t i = 0; i < count; ++i) {
      picture.triangle[i] = colour[4 * i] | colour[4 * i + 1] << 8 | colour[4 * i + 2] << 16 |
                            static_cast<uint32_t>(colour[4 * i + 3]) << 24;
      if (picture.triangle[i] == 0) continue;
      const double ndc = 2.0 * static_cast<double>(depth[i]) - 1;
      picture.depth[i] = 2 * near_m * far_m / (far_m + near_m - ndc * (far_m - near_m));
    }
  }

  // Two neighbouring samples show one surface: the same triangle, triangles that touch, or depths
  // no farther apart than the slopes there explain.
  bool Continuous(const Picture& picture, const Sensor& sensor, size_t i, size_t j,
                  double spacing_m) const {
    const uint32_t a = picture.triangle[i], b = picture.triangle[j];
    if (a == b) return true;
    if (a == 0 || b == 0) return false;
    for (const uint32_t v : part_.triangles[a - 1]) {
      for (const uint32_t w : part_.triangles[b - 1]) {
        if (v == w) return true;
      }
    }
    double slope = 0;
    for (const uint32_t t : {a, b}) {
      const double cosine = std::max(std::abs(Normal(t).dot(sensor.z)), 0.1);
      slope = std::max(slope, std::sqrt(1 - cosine * cosine) / cosine);
    }
    return std::abs(picture.depth[i] - picture.depth[j]) <= spacing_m * (0.5 + slope);
  }

  // The line between two neighbouring rows of a column, where the distance to the sheet changes
  // sign on one surface.
  void FindCrossing(int column, int row, std::vector<LiteralPoint>& points) const {
    const size_t i = seen_.At(column, row), j = seen_.At(column, row + 1);
    if (seen_.triangle[i] == 0 || seen_.triangle[j] == 0) return;
    const double x = (column + 0.5 - 0.5 * rig_.camera.columns_px) / focal_px_;
    const auto ray = [&](double sub_row) -> Eigen::Vector3d {
      const double y = (sub_row / sub_rows_ - 0.5 * rig_.camera.rows_px) / focal_px_;
      return camera_.z + x * camera_.x + y * camera_.y;
    };
    // Distance to the sheet over depth is linear in the row on a plane.
    const auto measure = [&](double sub_row, double depth) {
      return sheet_normal_.dot(camera_.origin) / depth + sheet_normal_.dot(ray(sub_row));
    };
    const double a = measure(row + 0.5, seen_.depth[i]), b = measure(row + 1.5, seen_.depth[j]);
    if ((a >= 0) == (b >= 0)) return;
    const double footprint = std::min(seen_.depth[i], seen_.depth[j]) / focal_px_;
    if (!Continuous(seen_, camera_, i, j, footprint / sub_rows_)) return;
    const double u = a / (a - b);
    const double sub_row = row + 0.5 + u;
    // Thesis eq. 1.3, solved for the point: the ray of the sub-pixel position meets the sheet.
    const Eigen::Vector3d direction = ray(sub_row);
    const double t = -sheet_normal_.dot(camera_.origin) / sheet_normal_.dot(direction);
    if (!(t > 0)) return;
    const Eigen::Vector3d p = camera_.origin + t * direction;
    const uint32_t triangle = seen_.triangle[u < 0.5 ? i : j];
    const Eigen::Vector3d normal = Normal(triangle);
    if (normal.dot(camera_.origin - p) <= 0 || normal.dot(laser_.origin - p) <= 0) return;
    if ((p - camera_.origin).norm() > rig_.max_range_m) return;
    const Eigen::Vector3d l = laser_.In(p);
    if (l.z() <= 0 || std::abs(l.x()) > l.z() * std::tan(0.5 * rig_.laser.fan_angle_rad)) return;
    // Lit: not behind what the laser's picture shows there, by more than the surface's own slope
    // over half a sample.
    const int sample =
        std::clamp(static_cast<int>((l.x() / l.z() / lit_.tan_x + 1) * 0.5 * kLaserSamples), 0,
                   kLaserSamples - 1);
    if (lit_.triangle[sample] == 0) return;
    const double width = 2 * lit_.tan_x * l.z() / kLaserSamples;
    // Along the fan the surface runs along sheet x surface.
    const Eigen::Vector3d line = sheet_normal_.cross(normal).normalized();
    const double slope =
        std::min(std::abs(line.dot(laser_.z)) / std::max(std::abs(line.dot(laser_.x)), 1e-3), 20.0);
    constexpr double kBiasM = 5e-5;
    if (l.z() > lit_.depth[sample] + kBiasM + width * (0.5 + slope)) return;
    points.push_back(
        {rotation_.transpose() * (p - offset_ - Eigen::Vector3d(stage_m_, 0, 0)) + centre_,
         part_.Normal(triangle - 1), column, sub_row / sub_rows_});
  }

  const TriangleMesh& part_;
  const Rig rig_;
  const int sub_rows_;
  Sensor camera_, laser_;
  Eigen::Vector3d sheet_normal_, offset_, centre_;
  Eigen::Matrix3d rotation_;
  double radius_, focal_px_, stage_m_ = 0;
  std::unique_ptr<GlContext> context_;
  std::unique_ptr<Framebuffer> camera_buffer_, laser_buffer_;
  GLint to_clip_ = -1;
  std::vector<Eigen::Vector3f> vertices_;
  Picture seen_, lit_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<LiteralScanner>> LiteralScanner::Make(const TriangleMesh& part,
                                                                     const Rig& rig,
                                                                     const Measurement& measurement,
                                                                     int sub_rows) {
  auto scanner = std::make_unique<LiteralScannerImpl>(part, rig, measurement, sub_rows);
  SIGHTLINE_RETURN_IF_ERROR(scanner->Init());
  return scanner;
}

}  // namespace sightline
