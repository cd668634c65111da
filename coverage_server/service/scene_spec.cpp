// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/service/scene_spec.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/digest/sha256.h"
#include "core/inspection/inspection.h"
#include "core/part/part_digest.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

constexpr int kMinFieldDirections = 16;
constexpr int kMaxFieldDirections = 65536;
constexpr size_t kMaxObstacles = 64;

std::string DeterministicBytes(const google::protobuf::Message& message) {
  std::string bytes;
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);
  message.SerializeToCodedStream(&coded);
  coded.Trim();
  return bytes;
}

// Degrees do not survive the conversion to radians and back exactly, so 1e-9 degrees are kept.
double RoundDegrees(double degrees) { return std::round(degrees * 1e9) / 1e9; }

absl::StatusOr<PartPlacement> ParsePlacement(const v1::PartPlacement& message) {
  const auto vector = [](const v1::Vector3& v) { return Eigen::Vector3d(v.x(), v.y(), v.z()); };
  PartPlacement placement;
  placement.centre_m = vector(message.centre_m());
  const Eigen::Vector3d rotation = vector(message.rotation_rad());
  constexpr double kFarthest_m = 10;
  if (!(placement.centre_m.cwiseAbs().array() <= kFarthest_m).all()) {
    return InvalidFields({{"spec.part_placement.centre_m", "every coordinate in [-10, 10] m"}});
  }
  const double angle = rotation.norm();
  if (!(angle <= std::numbers::pi)) {
    return InvalidFields({{"spec.part_placement.rotation_rad",
                           absl::StrCat("is ", angle, " long, must be at most pi")}});
  }
  if (angle > 0) {
    placement.rotation = Eigen::AngleAxisd(angle, rotation / angle).toRotationMatrix();
  }
  return placement;
}

// Rig, sampling and uncertainty of a spec whose own fields were checked. INVALID_ARGUMENT.
absl::Status ParseSettings(const v1::SceneSpec& spec, ParsedSceneSpec* parsed) {
  absl::StatusOr<Rig> parsed_rig = ParseRig(
      spec.rig(), spec.camera(), spec.has_lens() ? &spec.lens() : nullptr, spec.laser(), "spec");
  if (!parsed_rig.ok()) {
    return InvalidFields({{"spec", std::string(parsed_rig.status().message())}});
  }
  absl::StatusOr<TargetSampling> parsed_sampling = ParseTargetSampling(spec.targets(), "spec");
  if (!parsed_sampling.ok()) {
    return InvalidFields({{"spec.targets", std::string(parsed_sampling.status().message())}});
  }
  parsed->rig = *std::move(parsed_rig);
  parsed->sampling = *std::move(parsed_sampling);
  if (spec.has_part_placement()) {
    SIGHTLINE_ASSIGN_OR_RETURN(parsed->rig.part_placement, ParsePlacement(spec.part_placement()));
  }
  if (spec.has_measurement()) {
    absl::StatusOr<MeasurementDomain> domain = ParseMeasurementDomain(spec.measurement(), "spec");
    if (!domain.ok()) {
      return InvalidFields({{"spec.measurement", std::string(domain.status().message())}});
    }
    parsed->domain = *std::move(domain);
  }
  if (spec.has_detectability()) {
    absl::StatusOr<Detectability> detectability = ParseDetectability(spec.detectability(), "spec");
    if (!detectability.ok()) {
      return InvalidFields({{"spec.detectability", std::string(detectability.status().message())}});
    }
    for (const auto& [given, field] :
         {std::pair(detectability->min_exposure_time_s.has_value(), "min_exposure_time_s"),
          std::pair(detectability->max_exposure_time_s.has_value(), "max_exposure_time_s"),
          std::pair(!detectability->materials.empty(), "table")}) {
      if (!given)
        return InvalidFields({{absl::StrCat("spec.detectability.", field), "is missing"}});
    }
    parsed->detectability = *std::move(detectability);
  }
  if (!spec.has_uncertainty()) return absl::OkStatus();
  absl::StatusOr<UncertaintyModel> uncertainty = ParseUncertainty(spec.uncertainty(), "spec");
  if (!uncertainty.ok()) {
    return InvalidFields({{"spec.uncertainty", std::string(uncertainty.status().message())}});
  }
  parsed->uncertainty = *std::move(uncertainty);
  return absl::OkStatus();
}

// The fields that decide which points a scan measures.
v1::SceneSpec GeometryOf(v1::SceneSpec spec) {
  v1::TargetSampling limits;
  const v1::TargetSampling& targets = spec.targets();
  if (targets.has_max_pixel_footprint_m()) {
    limits.set_max_pixel_footprint_m(targets.max_pixel_footprint_m());
  }
  if (targets.has_max_circle_of_confusion_px()) {
    limits.set_max_circle_of_confusion_px(targets.max_circle_of_confusion_px());
  }
  if (targets.has_max_depth_per_pixel_m()) {
    limits.set_max_depth_per_pixel_m(targets.max_depth_per_pixel_m());
  }
  if (targets.has_max_incidence_deg()) {
    limits.set_max_incidence_deg(targets.max_incidence_deg());
  }
  *spec.mutable_targets() = std::move(limits);
  spec.clear_field_directions();
  spec.clear_uncertainty();
  spec.clear_measurement();
  return spec;
}

}  // namespace

absl::StatusOr<ParsedSceneSpec> ParseSceneSpec(const v1::SceneSpec& spec) {
  ParsedSceneSpec parsed;
  std::vector<FieldViolation> violations;
  const absl::StatusOr<PartName> part = ParsePartName(spec.part_digest());
  if (!part.ok()) {
    violations.push_back({"spec.part_digest", std::string(part.status().message())});
  }
  if (static_cast<size_t>(spec.obstacles_size()) > kMaxObstacles) {
    violations.push_back({"spec.obstacles", absl::StrCat("at most ", kMaxObstacles)});
  }
  for (int i = 0; i < spec.obstacles_size() && violations.size() < 10; ++i) {
    const v1::SceneObstacle& obstacle = spec.obstacles(i);
    const std::string path = absl::StrCat("spec.obstacles[", i, "]");
    if (const auto digest = ParsePartDigest(obstacle.part_digest()); !digest.ok()) {
      violations.push_back({path + ".part_digest", std::string(digest.status().message())});
    }
    const std::optional<ObstacleFrame> frame = ObstacleFrameFromProto(obstacle.frame());
    if (!frame) {
      violations.push_back({path + ".frame", absl::StrCat("must be ", kObstacleFrameNames)});
    }
    parsed.obstacles.push_back({obstacle.part_digest(), frame.value_or(ObstacleFrame::kPart)});
  }
  // Resting faces and the size of the table follow from the part; a scene must state the results.
  if (spec.rig().part_holding() == v1::Rig::PART_HOLDING_RESTING ||
      spec.rig().part_holding() == v1::Rig::PART_HOLDING_FIXTURE || spec.rig().has_table()) {
    violations.push_back({spec.rig().has_table() ? "spec.rig.table" : "spec.rig.part_holding",
                          "is of inspections: give measurement.resting_orientations (or alpha and "
                          "beta) and the table as an obstacle in FRAME_TABLE"});
  }
  parsed.field_directions =
      spec.has_field_directions() ? spec.field_directions() : kDefaultFieldDirections;
  const int root = static_cast<int>(std::lround(std::sqrt(std::max(0, parsed.field_directions))));
  if (parsed.field_directions < kMinFieldDirections ||
      parsed.field_directions > kMaxFieldDirections || root * root != parsed.field_directions) {
    violations.push_back({"spec.field_directions",
                          absl::StrCat(parsed.field_directions, ": must be a square number in [",
                                       kMinFieldDirections, ", ", kMaxFieldDirections, "]")});
  }
  SIGHTLINE_RETURN_IF_ERROR(InvalidFields(violations));

  SIGHTLINE_RETURN_IF_ERROR(ParseSettings(spec, &parsed));
  parsed.part_digest = spec.part_digest();
  parsed.part_has_materials = !part->materials.empty();

  v1::SceneSpec& normalised = parsed.normalised;
  normalised.set_part_digest(spec.part_digest());
  *normalised.mutable_camera() = CameraToProto(parsed.rig.camera);
  normalised.mutable_camera()->set_vertical_fov_deg(
      RoundDegrees(normalised.camera().vertical_fov_deg()));
  if (parsed.rig.lens) {
    normalised.mutable_lens()->set_focal_length_m(parsed.rig.lens->focal_length_m);
    normalised.mutable_lens()->set_f_number(parsed.rig.lens->f_number);
    if (parsed.rig.lens->focus_distance_m) {
      normalised.mutable_lens()->set_focus_distance_m(*parsed.rig.lens->focus_distance_m);
    }
  }
  *normalised.mutable_laser() = LaserToProto(parsed.rig.laser);
  normalised.mutable_laser()->set_fan_angle_deg(RoundDegrees(normalised.laser().fan_angle_deg()));
  *normalised.mutable_rig() = RigToProto(parsed.rig);
  *normalised.mutable_targets() = TargetSamplingToProto(parsed.sampling);
  normalised.mutable_targets()->set_max_normal_angle_deg(
      RoundDegrees(normalised.targets().max_normal_angle_deg()));
  if (normalised.targets().has_max_incidence_deg()) {
    normalised.mutable_targets()->set_max_incidence_deg(
        RoundDegrees(normalised.targets().max_incidence_deg()));
  }
  *normalised.mutable_obstacles() = spec.obstacles();
  normalised.set_field_directions(parsed.field_directions);
  if (parsed.domain) {
    *normalised.mutable_measurement() = MeasurementDomainToProto(*parsed.domain);
    for (auto& orientation : *normalised.mutable_measurement()->mutable_resting_orientations()) {
      orientation.clear_name();
    }
  }
  if (parsed.uncertainty) {
    *normalised.mutable_uncertainty() = UncertaintyToProto(*parsed.uncertainty);
    if (!parsed.uncertainty->detection.IsConstant()) {
      v1::LineDetection& detection = *normalised.mutable_uncertainty()->mutable_line_detection();
      for (double& angle_deg : *detection.mutable_table()->mutable_incidence_angles_deg()) {
        angle_deg = RoundDegrees(angle_deg);
      }
    }
  }
  if (spec.has_part_placement()) *normalised.mutable_part_placement() = spec.part_placement();
  if (spec.has_detectability()) {
    *normalised.mutable_detectability() = spec.detectability();
    // The table was computed with it; the limit depends on the table alone.
    normalised.mutable_detectability()->clear_min_detected_fraction();
  }
  parsed.digest = Sha256Hex(DeterministicBytes(normalised));
  parsed.geometry_digest = Sha256Hex(DeterministicBytes(GeometryOf(normalised)));
  // The scene depends on the normal form alone: same digest, same scene, bit by bit.
  SIGHTLINE_RETURN_IF_ERROR(ParseSettings(normalised, &parsed));
  return parsed;
}

}  // namespace sightline
