// SPDX-License-Identifier: Apache-2.0
#include "planner_client/setup_sheet/scene_drawing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/setup_sheet/direction_words.h"

namespace sightline {
namespace {

constexpr double kWidth = 360, kHeight = 260, kMargin = 34;
// Half the width of a letter and half the height of a line of text, and the baseline below the
// middle.
constexpr double kHalfLetter = 4.4, kHalfLine = 9, kBaseline = 5;

using Subject = v1::DrawnShape::Subject;
using Kind = v1::DrawnShape::Kind;

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

  void Line(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m, Subject subject,
            Kind kind = v1::DrawnShape::LINE) {
    v1::DrawnShape& line = Add(kind, subject);
    AddPoint(At(from_m), &line);
    AddPoint(At(to_m), &line);
  }

  void Polygon(const std::vector<Eigen::Vector2d>& corners_m, Subject subject) {
    v1::DrawnShape& area = Add(v1::DrawnShape::AREA, subject);
    for (const Eigen::Vector2d& corner_m : corners_m) AddPoint(At(corner_m), &area);
  }

  void Dot(const Eigen::Vector2d& place_m, double radius, Subject subject) {
    v1::DrawnShape& dot = Add(v1::DrawnShape::DOT, subject);
    AddPoint(At(place_m), &dot);
    dot.set_radius(radius);
  }

  // `away`: direction from the point to the middle of the text, in units of the drawing, y up.
  // The text moves from there to the nearest position inside the drawing that covers no earlier
  // text.
  void Text(const Eigen::Vector2d& place_m, const Eigen::Vector2d& away, const std::string& text) {
    const Eigen::Vector2d half(std::min(kHalfLetter * static_cast<double>(text.size()), kWidth / 2),
                               kHalfLine);
    const Eigen::Vector2d wanted = At(place_m) + Eigen::Vector2d(away.x(), -away.y());
    const Eigen::AlignedBox2d box = FreeBox(wanted, half);
    texts_.push_back(box);
    v1::DrawnShape& shape = Add(v1::DrawnShape::TEXT, v1::DrawnShape::PLAIN);
    AddPoint(box.center() + Eigen::Vector2d(0, kBaseline), &shape);
    shape.set_text(text);
  }

  // About the origin, angles from the vertical, positive to the right; as a polyline.
  void Arc(double radius, double from_rad, double to_rad, Subject subject) {
    constexpr int kPieces = 32;
    const Eigen::Vector2d origin = At(Eigen::Vector2d::Zero());
    v1::DrawnShape& arc = Add(v1::DrawnShape::LINE, subject);
    for (int i = 0; i <= kPieces; ++i) {
      const double angle = from_rad + (to_rad - from_rad) * i / kPieces;
      AddPoint({origin.x() + radius * std::sin(angle), origin.y() - radius * std::cos(angle)},
               &arc);
    }
  }

  v1::ReportDrawing Drawing(const std::string& alternative, const std::string& caption) const {
    v1::ReportDrawing drawing = drawing_;
    drawing.set_alternative(alternative);
    drawing.set_caption(caption);
    drawing.set_width(kWidth);
    drawing.set_height(kHeight);
    return drawing;
  }

 private:
  // Tries boxes on circles around the intended position, nearest first.
  Eigen::AlignedBox2d FreeBox(const Eigen::Vector2d& wanted, const Eigen::Vector2d& half) const {
    constexpr int kDirections = 16;
    constexpr double kStep = 3, kFarthest = 90;
    const Eigen::Vector2d limit(kWidth, kHeight);
    const auto inside = [&](const Eigen::Vector2d& middle) {
      const Eigen::Vector2d kept = middle.cwiseMax(half).cwiseMin(limit - half);
      return Eigen::AlignedBox2d(kept - half, kept + half);
    };
    const auto is_free = [&](const Eigen::AlignedBox2d& box) {
      return std::none_of(texts_.begin(), texts_.end(), [&](const Eigen::AlignedBox2d& other) {
        return !box.intersection(other).isEmpty();
      });
    };
    for (double radius = 0; radius <= kFarthest; radius += kStep) {
      for (int i = 0; i < kDirections; ++i) {
        const double angle = 2 * std::numbers::pi * i / kDirections;
        const Eigen::AlignedBox2d box =
            inside(wanted + radius * Eigen::Vector2d(std::sin(angle), std::cos(angle)));
        if (is_free(box)) return box;
      }
    }
    return inside(wanted);
  }

  v1::DrawnShape& Add(Kind kind, Subject subject) {
    v1::DrawnShape& shape = *drawing_.add_shapes();
    shape.set_kind(kind);
    shape.set_subject(subject);
    return shape;
  }

  // A tenth of a unit is less than a pixel.
  static void AddPoint(const Eigen::Vector2d& place, v1::DrawnShape* shape) {
    shape->add_x(std::round(10 * place.x()) / 10);
    shape->add_y(std::round(10 * place.y()) / 10);
  }

  double scale_ = 1;
  Eigen::Vector2d centre_m_;
  std::vector<Eigen::AlignedBox2d> texts_;
  v1::ReportDrawing drawing_;
};

std::string Millimetres(double length_m) { return absl::StrFormat("%.1f mm", 1e3 * length_m); }

std::string AngleText(double angle_rad) {
  return absl::StrFormat("%.1f\u00b0", std::abs(angle_rad) * 180 / std::numbers::pi);
}

// Draws a sensor's body as a box behind its pupil or source, at a visible size; its name is shifted
// by `name_offset`.
void DrawSensor(Canvas& canvas, const Eigen::Vector2d& at_m, double size_m, Subject subject,
                const char* name, const Eigen::Vector2d& name_offset) {
  const double distance = at_m.norm();
  const Eigen::Vector2d out =
      distance > 1e-9 ? Eigen::Vector2d(at_m / distance) : Eigen::Vector2d(0, 1);
  const Eigen::Vector2d side(-out.y(), out.x());
  canvas.Polygon(
      {at_m, at_m + size_m * (out + 0.6 * side), at_m + 2.2 * size_m * out + 0.6 * size_m * side,
       at_m + 2.2 * size_m * out - 0.6 * size_m * side, at_m + size_m * (out - 0.6 * side)},
      subject);
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

v1::ReportDrawing SideView(const DrawnScene& scene) {
  // The image rows, and with them the laser line, lie across the plane that both share.
  const Eigen::Vector3d across = scene.frames.camera.linear().col(0);
  Eigen::Vector3d right = across.cross(Eigen::Vector3d::UnitZ()).normalized();
  constexpr double kAlongY = 1e-6;
  if ((std::abs(right.x()) > kAlongY ? right.x() : right.y()) < 0) right = -right;
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
  canvas.Polygon(outline, v1::DrawnShape::PART);
  canvas.Line({shown.min().x(), 0}, {shown.max().x(), 0}, v1::DrawnShape::AXIS,
              v1::DrawnShape::DASHED_LINE);
  canvas.Line({0, 0}, {0, 0.62 * farther_m}, v1::DrawnShape::AXIS, v1::DrawnShape::DASHED_LINE);
  canvas.Line({0, 0}, laser_m, v1::DrawnShape::LASER);
  canvas.Line({0, 0}, camera_m, v1::DrawnShape::CAMERA, v1::DrawnShape::DASHED_LINE);
  // From the laser to the camera, on the outer sides of the lines of sight, where labels never
  // overlap even if both are close.
  const Eigen::Vector2d between = camera_m.normalized() - laser_m.normalized();
  const Eigen::Vector2d apart =
      between.norm() > 1e-9 ? Eigen::Vector2d(between.normalized()) : Eigen::Vector2d(1, 0);
  DrawSensor(canvas, camera_m, body_m, v1::DrawnShape::CAMERA, "camera", 14 * apart);
  DrawSensor(canvas, laser_m, body_m, v1::DrawnShape::LASER, "laser", -14 * apart);
  canvas.Dot({0, 0}, 2.5, v1::DrawnShape::PLAIN);
  const double camera_rad = std::atan2(camera_m.x(), camera_m.y());
  const double laser_rad = std::atan2(laser_m.x(), laser_m.y());
  const auto label = [&](double angle_rad, double radius, const std::string& text) {
    canvas.Text({0, 0}, radius * Eigen::Vector2d(std::sin(angle_rad), std::cos(angle_rad)), text);
  };
  constexpr double kPolarRadius = 112, kAngleRadius = 64;
  if (std::abs(camera_rad) > 0.02) {
    canvas.Arc(kPolarRadius, 0, camera_rad, v1::DrawnShape::AXIS);
    label(camera_rad / 2, kPolarRadius + 16, AngleText(camera_rad));
  }
  canvas.Arc(kAngleRadius, laser_rad, camera_rad, v1::DrawnShape::PLAIN);
  label((camera_rad + laser_rad) / 2, kAngleRadius - 20, AngleText(camera_rad - laser_rad));
  canvas.Text(0.9 * camera_m, 38 * apart, Millimetres(camera_m.norm()));
  canvas.Text(0.9 * laser_m, -38 * apart, Millimetres(laser_m.norm()));
  return canvas.Drawing("Camera, laser and part, seen along the laser line",
                        absl::StrCat("Along the laser line, to the right ", PointsInWords(right),
                                     ", in the middle of the scan: polar angle of the camera, "
                                     "triangulation angle, distances to the origin"));
}

v1::ReportDrawing TopView(const DrawnScene& scene) {
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
  canvas.Polygon(outline, v1::DrawnShape::PART);
  canvas.Line({shown.min().x(), 0}, {shown.max().x(), 0}, v1::DrawnShape::AXIS,
              v1::DrawnShape::DASHED_LINE);
  canvas.Line({0, shown.min().y()}, {0, shown.max().y()}, v1::DrawnShape::AXIS,
              v1::DrawnShape::DASHED_LINE);
  canvas.Text({shown.max().x(), 0}, {14, 0}, "+x");
  canvas.Text({0, shown.max().y()}, {0, 14}, "+y");
  // The way of the part's centre while the scan runs, with an arrow.
  canvas.Line(start_m, end_m, v1::DrawnShape::PLAIN);
  const double head_m = 0.025 * size_m;
  canvas.Polygon({end_m, end_m + Eigen::Vector2d(-head_m, 0.6 * head_m),
                  end_m + Eigen::Vector2d(-head_m, -0.6 * head_m)},
                 v1::DrawnShape::PLAIN);
  canvas.Dot(start_m, 2.5, v1::DrawnShape::PLAIN);
  canvas.Text(start_m, {0, 15}, "start");
  canvas.Text(end_m, {0, 15}, "stop");
  canvas.Line({0, 0}, laser_m, v1::DrawnShape::LASER);
  canvas.Line({0, 0}, camera_m, v1::DrawnShape::CAMERA, v1::DrawnShape::DASHED_LINE);
  canvas.Dot(laser_m, 5, v1::DrawnShape::LASER);
  canvas.Dot(camera_m, 5, v1::DrawnShape::CAMERA);
  canvas.Text(laser_m, {0, -18}, "laser");
  canvas.Text(camera_m, {0, 18}, "camera");
  canvas.Dot({0, 0}, 2.5, v1::DrawnShape::PLAIN);
  // Arms of about a third of the part, from its middle.
  constexpr double kLeastHorizontal = 0.3;
  const Eigen::Vector2d middle_m = 0.5 * (start_m + end_m);
  const double arm_m = 0.35 * BoundsOf(outline).sizes().maxCoeff();
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector2d along = project(scene.frames.part.linear().col(axis));
    if (along.norm() < kLeastHorizontal) continue;
    const Eigen::Vector2d tip_m = middle_m + arm_m * along;
    canvas.Line(middle_m, tip_m, v1::DrawnShape::PART);
    canvas.Dot(tip_m, 2.5, v1::DrawnShape::PART);
    canvas.Text(tip_m, 10 * along.normalized(),
                absl::StrCat("CAD ", std::string(1, static_cast<char>('x' + axis))));
  }
  return canvas.Drawing("Camera, laser and part from above",
                        "From above, in the middle of the scan: the way of the part\u2019s centre, "
                        "and where its CAD axes point");
}

}  // namespace sightline
