// SPDX-License-Identifier: Apache-2.0
#include "planner_client/setup_sheet/scene_drawing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sightline {
namespace {

constexpr double kWidth = 360, kHeight = 260, kMargin = 34;

// Metres of a plane to the drawing, y up to y down.
class Canvas {
 public:
  explicit Canvas(const Eigen::AlignedBox2d& shown_m) {
    const Eigen::Vector2d size = shown_m.sizes().cwiseMax(1e-6);
    scale_ = std::min((kWidth - 2 * kMargin) / size.x(), (kHeight - 2 * kMargin) / size.y());
    centre_m_ = shown_m.center();
  }

  Eigen::Vector2d At(const Eigen::Vector2d& place_m) const {
    const Eigen::Vector2d away = scale_ * (place_m - centre_m_);
    return {kWidth / 2 + away.x(), kHeight / 2 - away.y()};
  }

  void Line(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m, const char* css_class) {
    const Eigen::Vector2d a = At(from_m), b = At(to_m);
    absl::StrAppendFormat(&body_,
                          "<line class=\"%s\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>\n",
                          css_class, a.x(), a.y(), b.x(), b.y());
  }

  void Polygon(const std::vector<Eigen::Vector2d>& corners_m, const char* css_class) {
    std::string points;
    for (const Eigen::Vector2d& corner_m : corners_m) {
      const Eigen::Vector2d corner = At(corner_m);
      absl::StrAppendFormat(&points, "%s%.1f,%.1f", points.empty() ? "" : " ", corner.x(),
                            corner.y());
    }
    absl::StrAppend(&body_, "<polygon class=\"", css_class, "\" points=\"", points, "\"/>\n");
  }

  void Dot(const Eigen::Vector2d& place_m, double radius, const char* css_class) {
    const Eigen::Vector2d place = At(place_m);
    absl::StrAppendFormat(&body_, "<circle class=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>\n",
                          css_class, place.x(), place.y(), radius);
  }

  // `away`: of the text's middle from the place, in units of the drawing, y up.
  void Text(const Eigen::Vector2d& place_m, const Eigen::Vector2d& away, const std::string& text) {
    const Eigen::Vector2d place = At(place_m);
    // Texts stay inside the drawing: about 7.8 units a letter of 15.
    const double half = 3.9 * static_cast<double>(text.size());
    const double x = std::clamp(place.x() + away.x(), std::min(half, kWidth / 2),
                                std::max(kWidth - half, kWidth / 2));
    const double y = std::clamp(place.y() - away.y() + 5, 15.0, kHeight - 4);
    absl::StrAppendFormat(&body_, "<text x=\"%.1f\" y=\"%.1f\">%s</text>\n", x, y, text);
  }

  // About the origin, angles from the vertical, positive to the right.
  void Arc(double radius, double from_rad, double to_rad, const char* css_class) {
    const Eigen::Vector2d origin = At(Eigen::Vector2d::Zero());
    const auto on = [&](double angle) {
      return Eigen::Vector2d(origin.x() + radius * std::sin(angle),
                             origin.y() - radius * std::cos(angle));
    };
    const Eigen::Vector2d a = on(from_rad), b = on(to_rad);
    absl::StrAppendFormat(
        &body_, "<path class=\"%s\" d=\"M%.1f %.1fA%.1f %.1f 0 %d %d %.1f %.1f\"/>\n", css_class,
        a.x(), a.y(), radius, radius, std::abs(to_rad - from_rad) > std::numbers::pi ? 1 : 0,
        to_rad > from_rad ? 1 : 0, b.x(), b.y());
  }

  std::string Svg(const char* title) const {
    return absl::StrFormat(
        "<svg class=\"drawing\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" aria-label=\"%s\">\n%s"
        "</svg>\n",
        kWidth, kHeight, title, body_);
  }

 private:
  double scale_ = 1;
  Eigen::Vector2d centre_m_;
  std::string body_;
};

std::string Millimetres(double length_m) { return absl::StrFormat("%.1f mm", 1e3 * length_m); }

std::string AngleText(double angle_rad) {
  return absl::StrFormat("%.1f\u00b0", std::abs(angle_rad) * 180 / std::numbers::pi);
}

// Body of a sensor as a box behind its pupil or source, drawn at a size that is seen; its name
// moved by `name_offset`.
void DrawSensor(Canvas& canvas, const Eigen::Vector2d& at_m, double size_m, const char* css_class,
                const char* name, const Eigen::Vector2d& name_offset) {
  const double distance = at_m.norm();
  const Eigen::Vector2d out =
      distance > 1e-9 ? Eigen::Vector2d(at_m / distance) : Eigen::Vector2d(0, 1);
  const Eigen::Vector2d side(-out.y(), out.x());
  canvas.Polygon(
      {at_m, at_m + size_m * (out + 0.6 * side), at_m + 2.2 * size_m * out + 0.6 * size_m * side,
       at_m + 2.2 * size_m * out - 0.6 * size_m * side, at_m + size_m * (out - 0.6 * side)},
      css_class);
  canvas.Text(at_m + 2.2 * size_m * out, 18 * out + name_offset, name);
}

Eigen::AlignedBox2d BoundsOf(const std::vector<Eigen::Vector2d>& points) {
  Eigen::AlignedBox2d bounds;
  for (const Eigen::Vector2d& point : points) bounds.extend(point);
  return bounds;
}

}  // namespace

std::vector<Eigen::Vector2d> ConvexHull(std::vector<Eigen::Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  std::vector<Eigen::Vector2d> hull(2 * points.size());
  size_t size = 0;
  const auto turns_left = [&](const Eigen::Vector2d& next) {
    const Eigen::Vector2d a = hull[size - 1] - hull[size - 2], b = next - hull[size - 2];
    return a.x() * b.y() - a.y() * b.x() > 0;
  };
  const auto add = [&](const Eigen::Vector2d& point, size_t least) {
    while (size >= least && !turns_left(point)) --size;
    hull[size++] = point;
  };
  for (const Eigen::Vector2d& point : points) add(point, 2);
  const size_t upper = size + 1;
  for (size_t i = points.size() - 1; i-- > 0;) add(points[i], upper);
  hull.resize(size - 1);  // the last one is the first
  return hull;
}

std::string SideViewSvg(const DrawnScene& scene) {
  // The image rows, and with them the laser line, lie across the plane that both share.
  const Eigen::Vector3d across = scene.frames.camera.linear().col(0);
  const Eigen::Vector3d right = across.cross(Eigen::Vector3d::UnitZ()).normalized();
  const auto project = [&](const Eigen::Vector3d& place_m) {
    return Eigen::Vector2d(right.dot(place_m), place_m.z());
  };
  std::vector<Eigen::Vector2d> points;
  points.reserve(scene.part_points_m.size());
  for (const Eigen::Vector3d& point_m : scene.part_points_m) points.push_back(project(point_m));
  const std::vector<Eigen::Vector2d> outline = ConvexHull(std::move(points));
  const Eigen::Vector2d camera_m = project(scene.frames.camera.translation());
  const Eigen::Vector2d laser_m = project(scene.frames.laser.translation());
  const double farther_m = std::max(camera_m.norm(), laser_m.norm());
  Eigen::AlignedBox2d shown = BoundsOf(outline);
  shown.extend(Eigen::Vector2d::Zero());
  const double body_m = 0.055 * farther_m;
  for (const Eigen::Vector2d& sensor_m : {camera_m, laser_m}) {
    shown.extend(Eigen::Vector2d(sensor_m * (1 + 2.2 * body_m / std::max(1e-9, sensor_m.norm()))));
  }
  Canvas canvas(shown);
  canvas.Polygon(outline, "part");
  canvas.Line({shown.min().x(), 0}, {shown.max().x(), 0}, "axis");
  canvas.Line({0, 0}, {0, 0.62 * farther_m}, "axis");
  canvas.Line({0, 0}, laser_m, "laser-line");
  canvas.Line({0, 0}, camera_m, "camera-line");
  // From the laser to the camera, across the lines of sight: on their outer sides no label meets
  // another, however near the two are.
  const Eigen::Vector2d between = camera_m.normalized() - laser_m.normalized();
  const Eigen::Vector2d apart =
      between.norm() > 1e-9 ? Eigen::Vector2d(between.normalized()) : Eigen::Vector2d(1, 0);
  DrawSensor(canvas, camera_m, body_m, "camera", "camera", 14 * apart);
  DrawSensor(canvas, laser_m, body_m, "laser", "laser", -14 * apart);
  canvas.Dot({0, 0}, 2.5, "origin");
  const double camera_rad = std::atan2(camera_m.x(), camera_m.y());
  const double laser_rad = std::atan2(laser_m.x(), laser_m.y());
  const auto label = [&](double angle_rad, double radius, const std::string& text) {
    canvas.Text({0, 0}, radius * Eigen::Vector2d(std::sin(angle_rad), std::cos(angle_rad)), text);
  };
  constexpr double kPolarRadius = 112, kAngleRadius = 64;
  if (std::abs(camera_rad) > 0.02) {
    canvas.Arc(kPolarRadius, 0, camera_rad, "angle");
    label(camera_rad / 2, kPolarRadius + 16, AngleText(camera_rad));
  }
  canvas.Arc(kAngleRadius, laser_rad, camera_rad, "angle strong");
  label((camera_rad + laser_rad) / 2, kAngleRadius - 20, AngleText(camera_rad - laser_rad));
  canvas.Text(0.9 * camera_m, 38 * apart, Millimetres(camera_m.norm()));
  canvas.Text(0.9 * laser_m, -38 * apart, Millimetres(laser_m.norm()));
  return canvas.Svg("Camera, laser and part, seen along the laser line");
}

std::string TopViewSvg(const DrawnScene& scene) {
  const auto project = [](const Eigen::Vector3d& place_m) {
    return Eigen::Vector2d(place_m.x(), place_m.y());
  };
  std::vector<Eigen::Vector2d> points;
  points.reserve(scene.part_points_m.size());
  for (const Eigen::Vector3d& point_m : scene.part_points_m) points.push_back(project(point_m));
  const std::vector<Eigen::Vector2d> outline = ConvexHull(std::move(points));
  const Eigen::Vector2d camera_m = project(scene.frames.camera.translation());
  const Eigen::Vector2d laser_m = project(scene.frames.laser.translation());
  const Eigen::Vector2d start_m = project(scene.centre_at_start_m);
  const Eigen::Vector2d end_m = project(scene.centre_at_end_m);
  Eigen::AlignedBox2d shown = BoundsOf(outline);
  for (const Eigen::Vector2d& place_m :
       {Eigen::Vector2d(0, 0), camera_m, laser_m, start_m, end_m}) {
    shown.extend(place_m);
  }
  const double size_m = shown.sizes().maxCoeff();
  Canvas canvas(shown);
  canvas.Polygon(outline, "part");
  canvas.Line({shown.min().x(), 0}, {shown.max().x(), 0}, "axis");
  canvas.Line({0, shown.min().y()}, {0, shown.max().y()}, "axis");
  canvas.Text({shown.max().x(), 0}, {14, 0}, "+x");
  canvas.Text({0, shown.max().y()}, {0, 14}, "+y");
  // The way of the part's centre while the scan runs, with an arrow.
  canvas.Line(start_m, end_m, "travel");
  const double head_m = 0.025 * size_m;
  canvas.Polygon({end_m, end_m + Eigen::Vector2d(-head_m, 0.6 * head_m),
                  end_m + Eigen::Vector2d(-head_m, -0.6 * head_m)},
                 "arrow");
  canvas.Dot(start_m, 2.5, "arrow");
  canvas.Text(start_m, {0, 15}, "start");
  canvas.Text(end_m, {0, 15}, "stop");
  canvas.Line({0, 0}, laser_m, "laser-line");
  canvas.Line({0, 0}, camera_m, "camera-line");
  canvas.Dot(laser_m, 5, "laser");
  canvas.Dot(camera_m, 5, "camera");
  canvas.Text(laser_m, {0, -18}, "laser");
  canvas.Text(camera_m, {0, 18}, "camera");
  canvas.Dot({0, 0}, 2.5, "origin");
  return canvas.Svg("Camera, laser and part from above");
}

}  // namespace sightline
