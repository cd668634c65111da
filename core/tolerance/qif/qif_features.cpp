// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/qif/qif_features.h"

#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/text/number.h"

namespace sightline {
namespace {

using Eigen::Vector3d;

// Ends reading of a feature whose geometry is not stated in full.
struct NotStated {};
// Ends reading: the file breaks the rules of QIF.
struct Wrong {
  absl::Status status;
};

[[noreturn]] void Refuse(const QifElement& element, const std::string& why) {
  throw Wrong{absl::InvalidArgumentError(
      absl::StrCat(element.line, ": <", element.name, ">: ", why))};
}

class FeatureReader {
 public:
  FeatureReader(const QifElement& nominal, const QifElement& definition, const QifUnits& units)
      : nominal_(nominal), definition_(definition), units_(units) {}

  std::vector<NominalFace> Read() const {
    const std::string kind(absl::StripSuffix(nominal_.name, "FeatureNominal"));
    if (kind == "Plane") return {Plane()};
    if (kind == "Cylinder" || kind == "CylindricalSegment") return {Cylinder()};
    if (kind == "Cone" || kind == "ConicalSegment") return {Cone()};
    if (kind == "Sphere" || kind == "SphericalSegment") return {Sphere()};
    if (kind == "Torus" || kind == "ToroidalSegment") return {Torus()};
    if (kind == "OppositeParallelPlanes") return Width();
    return {};
  }

 private:
  static const QifElement& Needed(const QifElement& parent, const char* name) {
    const QifElement* child = parent.Child(name);
    if (child == nullptr) throw NotStated{};
    return *child;
  }

  double Number(const QifElement& element, bool angle = false) const {
    const auto value = ParseReal(element.text);
    if (!value.ok()) Refuse(element, std::string(value.status().message()));
    return *value * Scale(element, angle);
  }

  double Scale(const QifElement& element, bool angle = false) const {
    const auto scale = units_.Scale(element, angle);
    if (!scale.ok()) throw NotStated{};
    return *scale;
  }

  // Three numbers for each of `count` points.
  static std::vector<Vector3d> Vectors(const QifElement& element, size_t count) {
    const std::vector<absl::string_view> words =
        absl::StrSplit(element.text, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty());
    if (words.size() != 3 * count) {
      Refuse(element, absl::StrCat("has ", words.size(), " numbers, must have ", 3 * count));
    }
    std::vector<Vector3d> vectors(count);
    for (size_t i = 0; i < words.size(); ++i) {
      const auto value = ParseReal(std::string(words[i]));
      if (!value.ok()) Refuse(element, std::string(value.status().message()));
      vectors[i / 3][static_cast<Eigen::Index>(i % 3)] = *value;
    }
    return vectors;
  }

  Vector3d Point(const QifElement& element) const {
    return Scale(element) * Vectors(element, 1).front();
  }

  static Vector3d Direction(const QifElement& element) {
    const Vector3d direction = Vectors(element, 1).front();
    const double length = direction.norm();
    if (!(length > 0) || !std::isfinite(length)) Refuse(element, "is no direction");
    return direction / length;
  }

  // Normals of holes and slots point against the gradient of the distance.
  int Side() const {
    const std::string& side = definition_.ChildText("InternalExternal");
    return side == "INTERNAL" ? -1 : side == "EXTERNAL" ? 1 : 0;
  }

  NominalFace Plane() const {
    NominalFace face;
    face.surface.kind = SurfaceKind::kPlane;
    face.surface.point_m = Point(Needed(nominal_, "Location"));
    face.surface.axis = Direction(Needed(nominal_, "Normal"));
    face.side = 1;
    if (const QifElement* line = nominal_.Child("PolyLine")) {
      const auto count = line->attributes.find("count");
      size_t points = 0;
      if (count == line->attributes.end() || !absl::SimpleAtoi(count->second, &points) ||
          points > kMostOutlinePoints) {
        Refuse(*line, absl::StrCat("attribute count must be a number of at most ",
                                   kMostOutlinePoints, " points"));
      }
      face.outline_m = Vectors(*line, points);
      const double scale = Scale(*line);
      for (Vector3d& p : face.outline_m) p *= scale;
    }
    return face;
  }

  NominalFace Cylinder() const {
    const QifElement& axis = Needed(nominal_, "Axis");
    NominalFace face;
    face.surface.kind = SurfaceKind::kCylinder;
    face.surface.point_m = Point(Needed(axis, "AxisPoint"));
    face.surface.axis = Direction(Needed(axis, "Direction"));
    face.surface.radius_m = 0.5 * Number(Needed(definition_, "Diameter"));
    face.side = Side();
    if (const QifElement* length = definition_.Child("Length")) {
      // The axis point may be at either end or in the middle.
      AddSlab(face, face.surface.axis, face.surface.point_m, Number(*length));
    }
    return face;
  }

  NominalFace Cone() const {
    const QifElement& axis = Needed(nominal_, "Axis");
    NominalFace face;
    const Vector3d point = Point(Needed(axis, "AxisPoint"));
    const Vector3d direction = Direction(Needed(axis, "Direction"));
    const double half_angle = Number(Needed(definition_, "HalfAngle"), /*angle=*/true);
    if (!(half_angle > 0 && half_angle < 1.57)) throw NotStated{};
    const double to_apex_m =
        0.5 * Number(Needed(definition_, "Diameter")) / std::tan(half_angle);
    NominalSurface cone;
    cone.kind = SurfaceKind::kCone;
    cone.half_angle_rad = half_angle;
    cone.axis = direction;
    cone.point_m = point - to_apex_m * direction;
    face.surface = cone;
    cone.axis = -direction;
    cone.point_m = point + to_apex_m * direction;
    face.alternative = cone;
    face.side = Side();
    return face;
  }

  NominalFace Sphere() const {
    NominalFace face;
    face.surface.kind = SurfaceKind::kSphere;
    face.surface.point_m = Point(Needed(nominal_, "Location"));
    face.surface.radius_m = 0.5 * Number(Needed(definition_, "Diameter"));
    face.side = Side();
    return face;
  }

  NominalFace Torus() const {
    NominalFace face;
    face.surface.kind = SurfaceKind::kTorus;
    face.surface.point_m = Point(Needed(nominal_, "Location"));
    face.surface.axis = Direction(Needed(nominal_, "AxisVector"));
    face.surface.radius_m = 0.5 * Number(Needed(definition_, "MajorDiameter"));
    face.surface.tube_radius_m = 0.5 * Number(Needed(definition_, "MinorDiameter"));
    face.side = Side();
    return face;
  }

  // Planes on either side of a middle plane, whose extent is that of the feature.
  std::vector<NominalFace> Width() const {
    const QifElement& middle = Needed(nominal_, "CenterPlane");
    const Vector3d point = Point(Needed(middle, "Point"));
    const Vector3d normal = Direction(Needed(middle, "Normal"));
    const double half_m = 0.5 * Number(Needed(definition_, "Width"));
    std::vector<NominalFace> faces;
    for (const double sign : {-1.0, 1.0}) {
      NominalFace face;
      face.surface.kind = SurfaceKind::kPlane;
      face.surface.axis = sign * normal;
      face.surface.point_m = point + half_m * face.surface.axis;
      face.side = Side();
      if (const QifElement* along = nominal_.Child("LengthVector")) {
        const Vector3d length = Direction(*along), depth = normal.cross(length);
        if (const QifElement* l = definition_.Child("Length")) {
          AddSlab(face, length, point, 0.5 * Number(*l));
        }
        if (const QifElement* d = definition_.Child("Depth"); d != nullptr && depth.norm() > 0.5) {
          AddSlab(face, depth.normalized(), point, 0.5 * Number(*d));
        }
      }
      faces.push_back(std::move(face));
    }
    return faces;
  }

  static void AddSlab(NominalFace& face, const Vector3d& direction, const Vector3d& point_m,
                      double reach_m) {
    const double middle_m = direction.dot(point_m);
    face.slabs.push_back({direction, middle_m - reach_m, middle_m + reach_m});
  }

  static constexpr size_t kMostOutlinePoints = 100'000;

  const QifElement& nominal_;
  const QifElement& definition_;
  const QifUnits& units_;
};

}  // namespace

absl::StatusOr<std::vector<NominalFace>> FacesOfQifFeature(const QifElement& nominal,
                                                           const QifElement& definition,
                                                           const QifUnits& units) {
  try {
    return FeatureReader(nominal, definition, units).Read();
  } catch (const NotStated&) {
    return std::vector<NominalFace>();
  } catch (const Wrong& wrong) {
    return wrong.status;
  }
}

}  // namespace sightline
