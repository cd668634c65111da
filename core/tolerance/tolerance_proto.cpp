// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/tolerance_proto.h"

#include <cmath>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

// Both enumerations list the kinds in the same order; the proto's first value is "unspecified".
static_assert(static_cast<int>(ToleranceKind::kFlatness) + 1 == v1::TOLERANCE_KIND_FLATNESS);
static_assert(static_cast<int>(ToleranceKind::kTotalRunout) + 1 == v1::TOLERANCE_KIND_TOTAL_RUNOUT);
static_assert(static_cast<int>(ToleranceKind::kAngularDistance) + 1 ==
              v1::TOLERANCE_KIND_ANGULAR_DISTANCE);

void ItemToProto(const Tolerance& tolerance, v1::ToleranceItem* item) {
  item->set_id(tolerance.id);
  item->set_name(tolerance.name);
  item->set_kind(static_cast<v1::ToleranceKind>(static_cast<int>(tolerance.kind) + 1));
  item->set_zone_width_m(tolerance.zone_width_m);
  item->set_zone_width_rad(tolerance.zone_width_rad);
  item->set_diameter_zone(tolerance.diameter_zone);
  if (tolerance.nominal_m) item->set_nominal_m(*tolerance.nominal_m);
  if (tolerance.lower_m) item->set_lower_m(*tolerance.lower_m);
  if (tolerance.upper_m) item->set_upper_m(*tolerance.upper_m);
  if (tolerance.nominal_rad) item->set_nominal_rad(*tolerance.nominal_rad);
  if (tolerance.lower_rad) item->set_lower_rad(*tolerance.lower_rad);
  if (tolerance.upper_rad) item->set_upper_rad(*tolerance.upper_rad);
  for (const std::string& datum : tolerance.datums) item->add_datums(datum);
  for (const std::string& modifier : tolerance.modifiers) item->add_modifiers(modifier);
  for (const int face : tolerance.faces) item->add_faces(face);
  for (const std::string& feature : tolerance.features) item->add_features(feature);
  item->set_text(tolerance.text);
}

absl::Status Wrong(const std::string& field, const std::string& value, const std::string& allowed) {
  return absl::InvalidArgumentError(absl::StrCat(field, ": is ", value, "; must be ", allowed));
}

absl::Status CheckWidth(const std::string& field, double width) {
  if (std::isfinite(width) && width >= 0) return absl::OkStatus();
  return Wrong(field, NumberText(width), "finite and >= 0");
}

absl::Status CheckLimits(const std::string& path, const std::string& unit,
                         const std::optional<double>& lower, const std::optional<double>& upper) {
  for (const auto& [name, value] : {std::pair{"lower_", lower}, std::pair{"upper_", upper}}) {
    if (value && !std::isfinite(*value)) {
      return Wrong(absl::StrCat(path, ".", name, unit), NumberText(*value), "finite");
    }
  }
  if (lower && upper && *lower > *upper) {
    return Wrong(path + ".lower_" + unit, NumberText(*lower),
                 absl::StrCat("at most upper_", unit, ", ", NumberText(*upper)));
  }
  return absl::OkStatus();
}

template <typename Field>
std::vector<std::string> Strings(const Field& field) {
  return {field.begin(), field.end()};
}

absl::StatusOr<std::vector<int>> FaceNumbers(
    const std::string& path, const google::protobuf::RepeatedField<int32_t>& numbers) {
  for (int i = 0; i < numbers.size(); ++i) {
    if (numbers[i] < 1) {
      return Wrong(absl::StrCat(path, ".faces[", i, "]"), absl::StrCat(numbers[i]), ">= 1");
    }
  }
  return std::vector<int>(numbers.begin(), numbers.end());
}

absl::StatusOr<Tolerance> ItemFromProto(const v1::ToleranceItem& item, const std::string& path) {
  Tolerance tolerance;
  tolerance.id = item.id();
  tolerance.name = item.name();
  if (item.name().empty()) return Wrong(path + ".name", "empty", "given");
  if (item.id().empty()) return Wrong(path + ".id", "empty", "given");
  if (item.kind() < v1::TOLERANCE_KIND_FLATNESS ||
      item.kind() > v1::TOLERANCE_KIND_ANGULAR_DISTANCE) {
    return Wrong(path + ".kind", "not given or unknown", "one of TOLERANCE_KIND_...");
  }
  tolerance.kind = static_cast<ToleranceKind>(static_cast<int>(item.kind()) - 1);
  tolerance.zone_width_m = item.zone_width_m();
  tolerance.zone_width_rad = item.zone_width_rad();
  tolerance.diameter_zone = item.diameter_zone();
  const auto optional = [](bool has, double value) {
    return has ? std::optional<double>(value) : std::nullopt;
  };
  tolerance.nominal_m = optional(item.has_nominal_m(), item.nominal_m());
  tolerance.lower_m = optional(item.has_lower_m(), item.lower_m());
  tolerance.upper_m = optional(item.has_upper_m(), item.upper_m());
  tolerance.nominal_rad = optional(item.has_nominal_rad(), item.nominal_rad());
  tolerance.lower_rad = optional(item.has_lower_rad(), item.lower_rad());
  tolerance.upper_rad = optional(item.has_upper_rad(), item.upper_rad());
  for (const absl::Status& status :
       {CheckWidth(path + ".zone_width_m", tolerance.zone_width_m),
        CheckWidth(path + ".zone_width_rad", tolerance.zone_width_rad),
        CheckLimits(path, "m", tolerance.lower_m, tolerance.upper_m),
        CheckLimits(path, "rad", tolerance.lower_rad, tolerance.upper_rad)}) {
    if (!status.ok()) return status;
  }
  tolerance.datums = Strings(item.datums());
  tolerance.modifiers = Strings(item.modifiers());
  tolerance.features = Strings(item.features());
  tolerance.text = item.text();
  SIGHTLINE_ASSIGN_OR_RETURN(tolerance.faces, FaceNumbers(path, item.faces()));
  return tolerance;
}

}  // namespace

v1::ToleranceReport ToleranceReportToProto(const ToleranceReport& report,
                                           const std::vector<FaceTriangles>& faces) {
  v1::ToleranceReport message;
  message.set_file(report.file);
  message.set_standard(report.standard);
  for (const Tolerance& tolerance : report.read) ItemToProto(tolerance, message.add_read());
  for (const Tolerance& tolerance : report.untoleranced) {
    ItemToProto(tolerance, message.add_untoleranced());
  }
  for (const Datum& datum : report.datums) {
    v1::ToleranceDatum* item = message.add_datums();
    item->set_id(datum.id);
    item->set_letter(datum.letter);
    item->set_target(datum.target);
    for (const int face : datum.faces) item->add_faces(face);
    for (const std::string& feature : datum.features) item->add_features(feature);
  }
  for (const UnreadTolerance& unread : report.not_read) {
    v1::UnreadTolerance* item = message.add_not_read();
    item->set_name(unread.name);
    item->set_reason(unread.reason);
  }
  message.set_entity_count(report.entity_count);
  for (const std::string& note : report.notes) message.add_notes(note);
  for (const FaceTriangles& face : faces) {
    v1::FaceMesh* mesh = message.add_faces();
    mesh->set_face(face.face);
    for (const Eigen::Vector3d& p : face.positions_m) {
      for (int k = 0; k < 3; ++k) mesh->add_positions_m(p[k]);
    }
    for (const auto& triangle : face.triangles) {
      for (const uint32_t index : triangle) mesh->add_triangles(index);
    }
  }
  return message;
}

absl::StatusOr<ToleranceReport> ToleranceReportFromProto(const v1::ToleranceReport& message) {
  ToleranceReport report;
  report.file = message.file();
  report.standard = message.standard();
  for (int i = 0; i < message.read_size(); ++i) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto tolerance,
                               ItemFromProto(message.read(i), absl::StrCat("read[", i, "]")));
    report.read.push_back(std::move(tolerance));
  }
  for (int i = 0; i < message.untoleranced_size(); ++i) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto tolerance,
        ItemFromProto(message.untoleranced(i), absl::StrCat("untoleranced[", i, "]")));
    report.untoleranced.push_back(std::move(tolerance));
  }
  for (int i = 0; i < message.datums_size(); ++i) {
    const v1::ToleranceDatum& item = message.datums(i);
    SIGHTLINE_ASSIGN_OR_RETURN(auto faces,
                               FaceNumbers(absl::StrCat("datums[", i, "]"), item.faces()));
    report.datums.push_back(
        {item.id(), item.letter(), item.target(), std::move(faces), Strings(item.features())});
  }
  for (const v1::UnreadTolerance& item : message.not_read()) {
    report.not_read.push_back({item.name(), item.reason()});
  }
  report.entity_count = message.entity_count();
  report.notes = Strings(message.notes());
  return report;
}

absl::StatusOr<std::vector<FaceTriangles>> FacesFromProto(const v1::ToleranceReport& message) {
  std::vector<FaceTriangles> faces;
  std::set<int> seen;
  for (int i = 0; i < message.faces_size(); ++i) {
    const v1::FaceMesh& mesh = message.faces(i);
    const std::string path = absl::StrCat("faces[", i, "]");
    if (mesh.face() < 1 || !seen.insert(mesh.face()).second) {
      return Wrong(path + ".face", absl::StrCat(mesh.face()), ">= 1 and in the list once");
    }
    if (mesh.positions_m_size() % 3 != 0) {
      return Wrong(path + ".positions_m", absl::StrCat(mesh.positions_m_size(), " numbers"),
                   "three per vertex");
    }
    if (mesh.triangles_size() % 3 != 0) {
      return Wrong(path + ".triangles", absl::StrCat(mesh.triangles_size(), " numbers"),
                   "three per triangle");
    }
    FaceTriangles face;
    face.face = mesh.face();
    for (int k = 0; k < mesh.positions_m_size(); k += 3) {
      const Eigen::Vector3d p(mesh.positions_m(k), mesh.positions_m(k + 1),
                              mesh.positions_m(k + 2));
      if (!p.allFinite()) {
        return Wrong(absl::StrCat(path, ".positions_m[", k, "]"), "not finite", "finite");
      }
      face.positions_m.push_back(p);
    }
    for (int k = 0; k < mesh.triangles_size(); ++k) {
      if (mesh.triangles(k) >= face.positions_m.size()) {
        return Wrong(absl::StrCat(path, ".triangles[", k, "]"), absl::StrCat(mesh.triangles(k)),
                     absl::StrCat("< ", face.positions_m.size(), ", the number of vertices"));
      }
      if (k % 3 == 2) {
        face.triangles.push_back({mesh.triangles(k - 2), mesh.triangles(k - 1), mesh.triangles(k)});
      }
    }
    faces.push_back(std::move(face));
  }
  return faces;
}

}  // namespace sightline
