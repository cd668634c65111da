// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/qif/qif_features.h"

#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

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
  throw Wrong{
      absl::InvalidArgumentError(absl::StrCat(element.line, ": <", element.name, ">: ", why))};
}

constexpr size_t kMostOutlinePoints = 100'000;

// Reads parts of geometry.
class GeometryReader {
 public:
  explicit GeometryReader(const QifUnits& units) : units_(units) {}

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

  double Positive(const QifElement& element) const {
    const double value = Number(element);
    if (!(value > 0)) Refuse(element, "must be above 0");
    return value;
  }

  double Scale(const QifElement& element, bool angle = false) const {
    const auto scale = units_.Scale(element, angle);
    if (!scale.ok()) throw NotStated{};
    return *scale;
  }

  // `count` numbers of a text.
  static std::vector<double> Numbers(const QifElement& element, const std::string& text,
                                     size_t count) {
    const std::vector<absl::string_view> words =
        absl::StrSplit(text, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty());
    if (words.size() != count) {
      Refuse(element, absl::StrCat("has ", words.size(), " numbers, must have ", count));
    }
    std::vector<double> numbers;
    for (const absl::string_view word : words) {
      const auto value = ParseReal(std::string(word));
      if (!value.ok()) Refuse(element, std::string(value.status().message()));
      numbers.push_back(*value);
    }
    return numbers;
  }

  static std::vector<Vector3d> Vectors(const QifElement& element, size_t count) {
    const std::vector<double> numbers = Numbers(element, element.text, 3 * count);
    std::vector<Vector3d> vectors(count);
    for (size_t i = 0; i < count; ++i) {
      vectors[i] = Vector3d(numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]);
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

  static void AddSlab(NominalFace& face, const Vector3d& direction, const Vector3d& point_m,
                      double lower_m, double upper_m) {
    const double at_m = direction.dot(point_m);
    face.slabs.push_back({direction, at_m + lower_m, at_m + upper_m});
  }

 private:
  const QifUnits& units_;
};

class FeatureReader : private GeometryReader {
 public:
  FeatureReader(const QifElement& nominal, const QifElement& definition, const QifUnits& units)
      : GeometryReader(units), nominal_(nominal), definition_(definition) {}

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
    face.surface.radius_m = 0.5 * Positive(Needed(definition_, "Diameter"));
    face.side = Side();
    if (const QifElement* length = definition_.Child("Length")) {
      // The axis point may be at either end or in the middle.
      const double length_m = Number(*length);
      AddSlab(face, face.surface.axis, face.surface.point_m, -length_m, length_m);
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
    const double to_apex_m = 0.5 * Positive(Needed(definition_, "Diameter")) / std::tan(half_angle);
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
    face.surface.radius_m = 0.5 * Positive(Needed(definition_, "Diameter"));
    face.side = Side();
    return face;
  }

  NominalFace Torus() const {
    NominalFace face;
    face.surface.kind = SurfaceKind::kTorus;
    face.surface.point_m = Point(Needed(nominal_, "Location"));
    face.surface.axis = Direction(Needed(nominal_, "AxisVector"));
    face.surface.radius_m = 0.5 * Positive(Needed(definition_, "MajorDiameter"));
    face.surface.tube_radius_m = 0.5 * Positive(Needed(definition_, "MinorDiameter"));
    face.side = Side();
    return face;
  }

  // Planes on either side of a middle plane, whose extent is that of the feature.
  std::vector<NominalFace> Width() const {
    const QifElement& middle = Needed(nominal_, "CenterPlane");
    const Vector3d point = Point(Needed(middle, "Point"));
    const Vector3d normal = Direction(Needed(middle, "Normal"));
    const double half_m = 0.5 * Positive(Needed(definition_, "Width"));
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
          const double half_length_m = 0.5 * Number(*l);
          AddSlab(face, length, point, -half_length_m, half_length_m);
        }
        if (const QifElement* d = definition_.Child("Depth"); d != nullptr && depth.norm() > 0.5) {
          const double half_depth_m = 0.5 * Number(*d);
          AddSlab(face, depth.normalized(), point, -half_depth_m, half_depth_m);
        }
      }
      faces.push_back(std::move(face));
    }
    return faces;
  }

  const QifElement& nominal_;
  const QifElement& definition_;
};

class SurfaceReader : private GeometryReader {
 public:
  SurfaceReader(const QifElement& surface, const QifUnits& units)
      : GeometryReader(units), surface_(surface) {}

  std::vector<NominalFace> Read() const {
    const std::string& kind = surface_.name;
    if (kind == "Plane23") return {Plane(Needed(surface_, "Plane23Core"))};
    if (kind == "Cylinder23") return {Cylinder(Needed(surface_, "Cylinder23Core"))};
    if (kind == "Cone23") return {Cone(Needed(surface_, "Cone23Core"))};
    if (kind == "Sphere23") return {Sphere(Needed(surface_, "Sphere23Core"))};
    if (kind == "Torus23") return {Torus(Needed(surface_, "Torus23Core"))};
    return {};
  }

 private:
  // The loops of the faces say on which side the material is; here either counts.
  NominalFace Plane(const QifElement& core) const {
    NominalFace face;
    face.surface.kind = SurfaceKind::kPlane;
    face.surface.point_m = Point(Needed(core, "Origin"));
    const QifElement &along_u = Needed(core, "DirU"), &along_v = Needed(core, "DirV");
    const double scale = Scale(Needed(core, "Origin"));
    const Vector3d normal = Direction(along_u).cross(Direction(along_v));
    if (!(normal.norm() > 0.9)) Refuse(core, "DirU and DirV must be perpendicular");
    face.surface.axis = normal.normalized();
    for (const auto& [name, direction] :
         {std::pair{"domainU", &along_u}, std::pair{"domainV", &along_v}}) {
      const auto domain = core.attributes.find(name);
      if (domain == core.attributes.end()) throw NotStated{};
      const std::vector<double> ends = Numbers(core, domain->second, 2);
      AddSlab(face, Direction(*direction), face.surface.point_m, scale * ends[0], scale * ends[1]);
    }
    return face;
  }

  NominalFace Cylinder(const QifElement& core) const {
    NominalFace face = OnAxis(core, SurfaceKind::kCylinder);
    face.surface.radius_m = 0.5 * Positive(Needed(core, "Diameter"));
    AddSlab(face, face.surface.axis, face.surface.point_m, 0, Number(Needed(core, "Length")));
    return face;
  }

  NominalFace Cone(const QifElement& core) const {
    NominalFace face = OnAxis(core, SurfaceKind::kCone);
    const double length_m = Number(Needed(core, "Length"));
    const double bottom_m = 0.5 * Number(Needed(core, "DiameterBottom"));
    const double slope = (0.5 * Number(Needed(core, "DiameterTop")) - bottom_m) / length_m;
    if (!std::isfinite(slope) || slope == 0) throw NotStated{};
    AddSlab(face, face.surface.axis, face.surface.point_m, 0, length_m);
    face.surface.point_m -= bottom_m / slope * face.surface.axis;
    face.surface.half_angle_rad = std::atan(std::abs(slope));
    if (slope < 0) face.surface.axis = -face.surface.axis;
    return face;
  }

  NominalFace Sphere(const QifElement& core) const {
    NominalFace face;
    face.surface.kind = SurfaceKind::kSphere;
    face.surface.point_m = Point(Needed(core, "Location"));
    face.surface.radius_m = 0.5 * Positive(Needed(core, "Diameter"));
    return face;
  }

  NominalFace Torus(const QifElement& core) const {
    NominalFace face = OnAxis(core, SurfaceKind::kTorus);
    face.surface.radius_m = 0.5 * Positive(Needed(core, "DiameterMajor"));
    face.surface.tube_radius_m = 0.5 * Positive(Needed(core, "DiameterMinor"));
    return face;
  }

  NominalFace OnAxis(const QifElement& core, SurfaceKind kind) const {
    const QifElement& axis = Needed(core, "Axis");
    NominalFace face;
    face.surface.kind = kind;
    face.surface.point_m = Point(Needed(axis, "AxisPoint"));
    face.surface.axis = Direction(Needed(axis, "Direction"));
    return face;
  }

  const QifElement& surface_;
};

// The faces that `reader` reads.
template <typename Reader>
absl::StatusOr<std::vector<NominalFace>> Faces(const Reader& reader) {
  try {
    return reader.Read();
  } catch (const NotStated&) {
    return std::vector<NominalFace>();
  } catch (const Wrong& wrong) {
    return wrong.status;
  }
}

}  // namespace

absl::StatusOr<std::vector<NominalFace>> FaceOnQifSurface(const QifElement& surface,
                                                          const QifUnits& units) {
  return Faces(SurfaceReader(surface, units));
}

absl::StatusOr<std::vector<NominalFace>> FacesOfQifFeature(const QifElement& nominal,
                                                           const QifElement& definition,
                                                           const QifUnits& units) {
  return Faces(FeatureReader(nominal, definition, units));
}

}  // namespace sightline
