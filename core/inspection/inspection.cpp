#include "core/inspection/inspection.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/inspection/domain_message.h"
#include "core/inspection/field_checks.h"
#include "core/inspection/imaging.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"

namespace sightline {
namespace {

constexpr double kLargest = 1e9;  // stands for "no upper limit" where only the sign matters

// --- rig, camera, lens, laser -------------------------------------------------------------------

constexpr Limits kScanStep{1e-5, 0.1, " m"};
constexpr Limits kStageTravel{0, 20, " m", true};
constexpr Limits kMaxRange{0, 100, " m", true};
constexpr Limits kBodyLength{0, 10, " m", true};
constexpr Limits kBodyCentre{-10, 10, " m"};

Eigen::Vector3d ToVector(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

absl::Status CheckVector(const Checker& check, const std::string& path, const v1::Vector3& v,
                         const Limits& limits) {
  SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".x", v.x(), limits));
  SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".y", v.y(), limits));
  return check.Range(path + ".z", v.z(), limits);
}

absl::StatusOr<Body> ParseBody(const v1::Body& message, const std::string& path,
                               const Checker& check) {
  if (!message.has_centre_m()) return check.Error(path + ".centre_m", "is missing");
  SIGHTLINE_RETURN_IF_ERROR(
      CheckVector(check, path + ".centre_m", message.centre_m(), kBodyCentre));
  const Eigen::Vector3d centre = ToVector(message.centre_m());
  switch (message.shape_case()) {
    case v1::Body::kBox: {
      const std::string field = path + ".box.size_m";
      if (!message.box().has_size_m()) return check.Error(field, "is missing");
      SIGHTLINE_RETURN_IF_ERROR(CheckVector(check, field, message.box().size_m(), kBodyLength));
      return Body(BoxBody{centre, ToVector(message.box().size_m())});
    }
    case v1::Body::kCylinder: {
      const v1::Body::Cylinder& cylinder = message.cylinder();
      SIGHTLINE_RETURN_IF_ERROR(
          check.Range(path + ".cylinder.radius_m", cylinder.radius_m(), kBodyLength));
      SIGHTLINE_RETURN_IF_ERROR(
          check.Range(path + ".cylinder.length_m", cylinder.length_m(), kBodyLength));
      return Body(CylinderBody{centre, cylinder.radius_m(), cylinder.length_m()});
    }
    case v1::Body::SHAPE_NOT_SET:
      break;
  }
  return check.Error(path, "has no shape, must have box or cylinder");
}

template <typename Messages>
absl::Status ParseBodies(const Messages& messages, const std::string& path, const Checker& check,
                         std::vector<Body>* bodies) {
  if (messages.empty()) return absl::OkStatus();  // keeps the default
  bodies->clear();
  for (int i = 0; i < messages.size(); ++i) {
    absl::StatusOr<Body> body = ParseBody(messages[i], absl::StrCat(path, "[", i, "]"), check);
    if (!body.ok()) return body.status();
    bodies->push_back(*body);
  }
  return absl::OkStatus();
}

// --- targets ------------------------------------------------------------------------------------

constexpr Limits kSpacing{1e-4, 1, " m"};
constexpr Limits kCoverageRadius{0, 1, " m", true};
constexpr Limits kNormalAngle{0, 90, " deg", true};
constexpr Limits kFootprint{0, 1, " m", true};
constexpr Limits kConfusion{0, 1e4, " px", true};
constexpr Limits kPosition{-1000, 1000, " m"};
constexpr Limits kResolution{1e-5, 1, " m"};
constexpr Limits kZoneWidth{0, 1, " m", true};

// --- measurement domain -------------------------------------------------------------------------

struct ParameterTable {
  const char* name;
  bool angle;     // degrees in the file
  bool periodic;  // [0, 360)
  // Table 2.1 in the unit of the file.
  std::vector<ParameterDomain::Range> bounds;
};

const std::vector<ParameterTable>& Table21() {
  static const std::vector<ParameterTable> table = {
      {"camera_distance_m", false, false, {{0.1, 0.8}}},
      {"triangulation_angle_deg", true, false, {{-80, -10}, {10, 80}}},
      {"camera_azimuth_deg", true, true, {{0, 360}}},
      {"camera_polar_deg", true, false, {{0, 90}}},
      {"part_alpha_deg", true, true, {{0, 360}}},
      {"part_beta_deg", true, true, {{0, 360}}},
      {"part_gamma_deg", true, true, {{0, 360}}},
      {"offset_y_m", false, false, {{-0.5, 0.5}}},
      {"offset_z_m", false, false, {{-0.4, 0.4}}},
  };
  return table;
}

// A single value of a periodic parameter is below 360; a range may end there.
std::string BoundsText(const ParameterTable& parameter, bool single_value) {
  return absl::StrCat(absl::StrJoin(parameter.bounds, " or ",
                                    [&](std::string* out, const ParameterDomain::Range& range) {
                                      const bool open = parameter.periodic && single_value;
                                      absl::StrAppend(out, "[", NumberText(range.min), ", ",
                                                      NumberText(range.max), open ? ")" : "]");
                                    }),
                      parameter.angle ? " deg" : " m");
}

absl::Status CheckParameterValue(const Checker& check, const std::string& path, double value,
                                 const ParameterTable& parameter) {
  for (const ParameterDomain::Range& bound : parameter.bounds) {
    if (value >= bound.min && (parameter.periodic ? value < bound.max : value <= bound.max)) {
      return absl::OkStatus();
    }
  }
  return check.Error(
      path, absl::StrCat("is ", NumberText(value), ", must be in ", BoundsText(parameter, true)));
}

absl::StatusOr<ParameterDomain> ParseParameterDomain(const v1::ParameterDomain& message,
                                                     const ParameterTable& parameter,
                                                     const std::string& path,
                                                     const Checker& check) {
  const auto internal = [&](double value) { return parameter.angle ? Radians(value) : value; };
  const int given = message.has_fixed() + !message.values().empty() + !message.ranges().empty();
  if (given != 1) {
    return check.Error(path, absl::StrCat("has ", given == 0 ? "none" : "several",
                                          " of fixed, values, ranges, must have exactly one"));
  }
  ParameterDomain domain;
  domain.periodic = parameter.periodic;
  if (message.has_fixed()) {
    SIGHTLINE_RETURN_IF_ERROR(
        CheckParameterValue(check, path + ".fixed", message.fixed(), parameter));
    domain.values = {internal(message.fixed())};
    return domain;
  }
  for (int i = 0; i < message.values_size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(CheckParameterValue(check, absl::StrCat(path, ".values[", i, "]"),
                                                  message.values(i), parameter));
    domain.values.push_back(internal(message.values(i)));
  }
  std::sort(domain.values.begin(), domain.values.end());
  domain.values.erase(std::unique(domain.values.begin(), domain.values.end()), domain.values.end());

  std::vector<ParameterDomain::Range> ranges;
  for (int i = 0; i < message.ranges_size(); ++i) {
    const std::string field = absl::StrCat(path, ".ranges[", i, "]");
    const double min = message.ranges(i).min(), max = message.ranges(i).max();
    if (min > max) {
      return check.Error(
          field, absl::StrCat("has min ", NumberText(min), " above max ", NumberText(max),
                              parameter.periodic ? "; give a range across 0 as two ranges" : ""));
    }
    const bool inside =
        std::any_of(parameter.bounds.begin(), parameter.bounds.end(),
                    [&](const ParameterDomain::Range& b) { return min >= b.min && max <= b.max; });
    if (!inside) {
      return check.Error(field, absl::StrCat("is [", NumberText(min), ", ", NumberText(max),
                                             "], must lie inside ", BoundsText(parameter, false)));
    }
    ranges.push_back({internal(min), internal(max)});
  }
  std::sort(ranges.begin(), ranges.end(), [](const auto& a, const auto& b) {
    return std::pair(a.min, a.max) < std::pair(b.min, b.max);
  });
  for (const ParameterDomain::Range& range : ranges) {
    if (!domain.ranges.empty() && range.min <= domain.ranges.back().max) {
      domain.ranges.back().max = std::max(domain.ranges.back().max, range.max);
    } else {
      domain.ranges.push_back(range);
    }
  }
  return domain;
}

absl::StatusOr<MeasurementDomain> ParseMeasurementDomain(const v1::MeasurementDomain& message,
                                                         const Checker& check) {
  MeasurementDomain domain = ThesisDomain();
  const auto& table = Table21();
  const auto* descriptor = v1::MeasurementDomain::descriptor();
  const auto* reflection = message.GetReflection();
  for (int i = 0; i < kMeasurementParameters; ++i) {
    const auto* field = descriptor->FindFieldByName(table[i].name);
    if (!reflection->HasField(message, field)) continue;
    const auto& user =
        static_cast<const v1::ParameterDomain&>(reflection->GetMessage(message, field));
    absl::StatusOr<ParameterDomain> parsed =
        ParseParameterDomain(user, table[i], absl::StrCat("measurement.", table[i].name), check);
    if (!parsed.ok()) return parsed.status();
    domain.parameters[i] = *std::move(parsed);
  }
  if (message.resting_orientations_size() > 0) {
    for (const auto& [given, name] : {std::pair(message.has_part_alpha_deg(), "part_alpha_deg"),
                                      std::pair(message.has_part_beta_deg(), "part_beta_deg")}) {
      if (given) {
        return check.Error(absl::StrCat("measurement.", name),
                           "cannot be given together with measurement.resting_orientations");
      }
    }
  }
  for (int i = 0; i < message.resting_orientations_size(); ++i) {
    const v1::RestingOrientation& o = message.resting_orientations(i);
    const std::string path = absl::StrCat("measurement.resting_orientations[", i, "]");
    SIGHTLINE_RETURN_IF_ERROR(
        CheckParameterValue(check, path + ".part_alpha_deg", o.part_alpha_deg(), table[4]));
    SIGHTLINE_RETURN_IF_ERROR(
        CheckParameterValue(check, path + ".part_beta_deg", o.part_beta_deg(), table[5]));
    domain.resting_orientations.push_back(
        {Radians(o.part_alpha_deg()), Radians(o.part_beta_deg())});
  }
  return domain;
}

// --- files, goal, costs -------------------------------------------------------------------------

absl::Status CheckMeshFile(const Checker& check, const std::string& path, const std::string& file,
                           const std::string& unit) {
  if (file.empty()) return check.Error(path + ".file", "is missing");
  if (absl::Status status = CheckPartUnit(file, unit); !status.ok()) {
    return check.Error(path + ".unit", std::string(status.message()));
  }
  return absl::OkStatus();
}

absl::StatusOr<GainWeights> ParseGainWeights(const v1::GainWeights& message, const Checker& check) {
  GainWeights weights{message.coverage(), message.admissible(), message.relaxed(),
                      message.information(), message.total_uncertainty()};
  double sum = 0;
  for (const auto& [name, value] :
       {std::pair("coverage", weights.coverage), std::pair("admissible", weights.admissible),
        std::pair("relaxed", weights.relaxed), std::pair("information", weights.information),
        std::pair("total_uncertainty", weights.total_uncertainty)}) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range(absl::StrCat("goal.gain.", name), value, {0, 1e6, ""}));
    sum += value;
  }
  if (sum == 0) return check.Error("goal.gain", "has no weight above 0");
  return weights;
}

absl::StatusOr<PlanningGoal> ParseGoal(const v1::PlanningGoal& message, const Checker& check) {
  PlanningGoal goal;
  if (message.has_admissible()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("goal.admissible", message.admissible(), {0, 1, "", true}));
    if (message.has_coverage()) {
      return check.Error("goal.coverage",
                         "cannot be given together with goal.admissible: give coverage a weight "
                         "in goal.gain instead");
    }
    goal.admissible = message.admissible();
    goal.coverage = 0;
  }
  if (message.has_coverage()) goal.coverage = message.coverage();
  if (!goal.admissible) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("goal.coverage", goal.coverage, {0, 1, "", true}));
  }
  if (message.has_gain()) {
    if (!goal.admissible) return check.Error("goal.gain", "needs goal.admissible");
    absl::StatusOr<GainWeights> gain = ParseGainWeights(message.gain(), check);
    if (!gain.ok()) return gain.status();
    goal.gain = *gain;
  }
  if (message.has_max_scans()) goal.max_scans = message.max_scans();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("goal.max_scans", goal.max_scans, {1, 1000, ""}));
  if (message.has_max_time_s()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("goal.max_time_s", message.max_time_s(), {0, kLargest, " s", true}));
    goal.max_time_s = message.max_time_s();
  }
  if (message.has_min_gain()) goal.min_gain = message.min_gain();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("goal.min_gain", goal.min_gain, {0, 1, "", false, true}));
  return goal;
}

absl::StatusOr<CostModel> ParseCosts(const v1::CostModel& message, const Checker& check) {
  CostModel costs;
  if (message.has_stage_speed_m_per_s()) {
    costs.stage_speed_m_per_s = message.stage_speed_m_per_s();
    SIGHTLINE_RETURN_IF_ERROR(check.Range("costs.stage_speed_m_per_s", *costs.stage_speed_m_per_s,
                                          {0, 100, " m/s", true}));
  }
  if (message.has_frame_rate_hz()) {
    costs.frame_rate_hz = message.frame_rate_hz();
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("costs.frame_rate_hz", *costs.frame_rate_hz, {0, 1e6, " Hz", true}));
  }
  if (message.has_reposition_time_s()) {
    costs.reposition_time_s = message.reposition_time_s();
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("costs.reposition_time_s", *costs.reposition_time_s, {0, 1e6, " s"}));
  }
  if (message.has_reposition_speed_deg_per_s()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("costs.reposition_speed_deg_per_s",
                                          message.reposition_speed_deg_per_s(),
                                          {0, 1e6, " deg/s", true}));
    costs.reposition_speed_rad_per_s = Radians(message.reposition_speed_deg_per_s());
  }
  if (message.has_reposition_speed_m_per_s()) {
    costs.reposition_speed_m_per_s = message.reposition_speed_m_per_s();
    SIGHTLINE_RETURN_IF_ERROR(check.Range("costs.reposition_speed_m_per_s",
                                          *costs.reposition_speed_m_per_s, {0, 100, " m/s", true}));
  }
  return costs;
}

v1::Vector3 FromVector(const Eigen::Vector3d& v) {
  v1::Vector3 message;
  message.set_x(v.x());
  message.set_y(v.y());
  message.set_z(v.z());
  return message;
}

v1::Body BodyToProto(const Body& body) {
  v1::Body message;
  if (const auto* box = std::get_if<BoxBody>(&body)) {
    *message.mutable_centre_m() = FromVector(box->centre_m);
    *message.mutable_box()->mutable_size_m() = FromVector(box->size_m);
  } else {
    const auto& cylinder = std::get<CylinderBody>(body);
    *message.mutable_centre_m() = FromVector(cylinder.centre_m);
    message.mutable_cylinder()->set_radius_m(cylinder.radius_m);
    message.mutable_cylinder()->set_length_m(cylinder.length_m);
  }
  return message;
}

}  // namespace

bool CostModel::IsUnit() const {
  return !stage_speed_m_per_s && !frame_rate_hz && !reposition_time_s &&
         !reposition_speed_rad_per_s && !reposition_speed_m_per_s;
}

absl::StatusOr<Rig> ParseRig(const v1::Rig& message, const v1::Camera& camera, const v1::Lens* lens,
                             const v1::Laser& laser, const std::string& context) {
  const Checker check(context);
  Rig rig;
  if (lens != nullptr) {
    absl::StatusOr<Lens> parsed = ParseLens(*lens, context);
    if (!parsed.ok()) return parsed.status();
    rig.lens = *std::move(parsed);
  }
  absl::StatusOr<Camera> parsed_camera = ParseCamera(camera, rig.lens, context);
  if (!parsed_camera.ok()) return parsed_camera.status();
  rig.camera = *parsed_camera;
  absl::StatusOr<Laser> parsed_laser = ParseLaser(laser, context);
  if (!parsed_laser.ok()) return parsed_laser.status();
  rig.laser = *parsed_laser;
  if (message.has_scan_step_m()) rig.scan_step_m = message.scan_step_m();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("rig.scan_step_m", rig.scan_step_m, kScanStep));
  if (message.has_stage_travel_m()) rig.stage_travel_m = message.stage_travel_m();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("rig.stage_travel_m", rig.stage_travel_m, kStageTravel));
  if (message.has_max_range_m()) rig.max_range_m = message.max_range_m();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("rig.max_range_m", rig.max_range_m, kMaxRange));
  SIGHTLINE_RETURN_IF_ERROR(
      ParseBodies(message.camera_bodies(), "rig.camera_bodies", check, &rig.camera_bodies));
  SIGHTLINE_RETURN_IF_ERROR(
      ParseBodies(message.laser_bodies(), "rig.laser_bodies", check, &rig.laser_bodies));
  return rig;
}

absl::StatusOr<MeasurementDomain> ParseMeasurementDomain(const v1::MeasurementDomain& message,
                                                         const std::string& context) {
  return ParseMeasurementDomain(message, Checker(context));
}

absl::StatusOr<TargetSampling> ParseTargetSampling(const v1::TargetSampling& message,
                                                   const std::string& context) {
  const Checker check(context);
  TargetSampling sampling;
  if (message.has_spacing_m()) sampling.spacing_m = message.spacing_m();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("targets.spacing_m", sampling.spacing_m, kSpacing));
  if (message.has_coverage_radius_m()) sampling.coverage_radius_m = message.coverage_radius_m();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("targets.coverage_radius_m", sampling.coverage_radius_m, kCoverageRadius));
  if (message.has_max_normal_angle_deg()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("targets.max_normal_angle_deg", message.max_normal_angle_deg(), kNormalAngle));
    sampling.max_normal_angle_rad = Radians(message.max_normal_angle_deg());
  }
  if (message.has_seed()) sampling.seed = message.seed();
  std::set<std::string> names;
  for (int i = 0; i < message.regions_size(); ++i) {
    const v1::TargetRegion& region = message.regions(i);
    const std::string path = absl::StrCat("targets.regions[", i, "]");
    if (region.name().empty()) return check.Error(path + ".name", "is missing");
    if (!names.insert(region.name()).second) {
      return check.Error(path + ".name",
                         absl::StrCat("is \"", region.name(), "\" like that of another region"));
    }
    if (!region.has_min_m()) return check.Error(path + ".min_m", "is missing");
    if (!region.has_max_m()) return check.Error(path + ".max_m", "is missing");
    SIGHTLINE_RETURN_IF_ERROR(CheckVector(check, path + ".min_m", region.min_m(), kPosition));
    SIGHTLINE_RETURN_IF_ERROR(CheckVector(check, path + ".max_m", region.max_m(), kPosition));
    const Eigen::Vector3d min = ToVector(region.min_m()), max = ToVector(region.max_m());
    for (int axis = 0; axis < 3; ++axis) {
      if (min[axis] >= max[axis]) {
        return check.Error(absl::StrCat(path, ".max_m.", std::string(1, "xyz"[axis])),
                           absl::StrCat("is ", NumberText(max[axis]), ", must be above min_m.",
                                        std::string(1, "xyz"[axis]), " = ", NumberText(min[axis])));
      }
    }
    if (!region.has_spacing_m()) return check.Error(path + ".spacing_m", "is missing");
    SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".spacing_m", region.spacing_m(), kSpacing));
    sampling.regions.push_back({region.name(), min, max, region.spacing_m()});
    if (region.has_resolution_m()) {
      SIGHTLINE_RETURN_IF_ERROR(
          check.Range(path + ".resolution_m", region.resolution_m(), kResolution));
      sampling.regions.back().resolution_m = region.resolution_m();
    }
  }
  if (message.has_max_pixel_footprint_m()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("targets.max_pixel_footprint_m", message.max_pixel_footprint_m(), kFootprint));
    sampling.max_pixel_footprint_m = message.max_pixel_footprint_m();
  }
  if (message.has_max_circle_of_confusion_px()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("targets.max_circle_of_confusion_px",
                                          message.max_circle_of_confusion_px(), kConfusion));
    sampling.max_circle_of_confusion_px = message.max_circle_of_confusion_px();
  }
  return sampling;
}

absl::Status CheckLimitInputs(const Rig& rig, const TargetSampling& sampling,
                              const std::string& context) {
  if (!sampling.max_circle_of_confusion_px) return absl::OkStatus();
  const Checker check(context);
  const std::string needed = "is missing: targets.max_circle_of_confusion_px needs it";
  if (!rig.lens) return check.Error("lens", needed);
  if (!rig.camera.pixel_pitch_m) return check.Error("camera.pixel_pitch_m", needed);
  return absl::OkStatus();
}

namespace {

absl::StatusOr<TolerancedRegion> ParseTolerancedRegion(const v1::TolerancedRegion& message,
                                                       const std::string& path, bool has_file,
                                                       const Checker& check) {
  TolerancedRegion region;
  region.name = message.name();
  if (region.name.empty()) return check.Error(path + ".name", "is missing");
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range(path + ".zone_width_m", message.zone_width_m(), kZoneWidth));
  region.zone_width_m = message.zone_width_m();
  const bool box = message.has_min_m() || message.has_max_m();
  const int given = box + !message.materials().empty() + !message.faces().empty();
  if (given != 1) {
    return check.Error(path, absl::StrCat("has ", given == 0 ? "none" : "several",
                                          " of min_m with max_m, materials, faces, must have "
                                          "exactly one"));
  }
  if (box) {
    if (!message.has_min_m()) return check.Error(path + ".min_m", "is missing");
    if (!message.has_max_m()) return check.Error(path + ".max_m", "is missing");
    SIGHTLINE_RETURN_IF_ERROR(CheckVector(check, path + ".min_m", message.min_m(), kPosition));
    SIGHTLINE_RETURN_IF_ERROR(CheckVector(check, path + ".max_m", message.max_m(), kPosition));
    const Eigen::AlignedBox3d bounds(ToVector(message.min_m()), ToVector(message.max_m()));
    if ((bounds.sizes().array() <= 0).any()) {
      return check.Error(path + ".max_m", "must be above min_m along every axis");
    }
    region.box_m = bounds;
  }
  region.materials.assign(message.materials().begin(), message.materials().end());
  if (!message.faces().empty() && !has_file) {
    return check.Error(path + ".faces", "needs tolerances.file, a STEP file");
  }
  for (int i = 0; i < message.faces_size(); ++i) {
    if (message.faces(i) < 1) {
      return check.Error(absl::StrCat(path, ".faces[", i, "]"),
                         absl::StrCat("is ", message.faces(i), ", must be at least 1"));
    }
    region.faces.push_back(message.faces(i));
  }
  return region;
}

// Uncertainty model, tolerances, and what a goal of admissible uncertainties needs of both.
absl::Status ParseUncertaintyGoal(const v1::Inspection& message, const Checker& check,
                                  const std::string& context, Inspection* inspection) {
  if (message.has_uncertainty()) {
    absl::StatusOr<UncertaintyModel> model = ParseUncertainty(message.uncertainty(), context);
    if (!model.ok()) return model.status();
    inspection->uncertainty = *std::move(model);
    if (!message.rig().has_scan_step_m()) {
      // Points a sixth of the resolution apart leave nothing of the surface between them.
      double finest_m = inspection->uncertainty->resolution_m;
      for (const TargetRegion& region : inspection->targets.regions) {
        finest_m = std::min(finest_m, region.resolution_m.value_or(finest_m));
      }
      inspection->rig.scan_step_m = std::min(inspection->rig.scan_step_m, finest_m / 6);
    }
  }
  if (message.has_tolerances()) {
    const v1::ToleranceRequirements& given = message.tolerances();
    ToleranceRequirements requirements;
    if (given.has_zone_width_m()) {
      SIGHTLINE_RETURN_IF_ERROR(
          check.Range("tolerances.zone_width_m", given.zone_width_m(), kZoneWidth));
      requirements.zone_width_m = given.zone_width_m();
    }
    if (given.has_guard_factor()) requirements.guard_factor = given.guard_factor();
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("tolerances.guard_factor", requirements.guard_factor, {0, 100, "", true}));
    requirements.least_acceptance_zone = given.least_acceptance_zone();
    SIGHTLINE_RETURN_IF_ERROR(check.Range("tolerances.least_acceptance_zone",
                                          requirements.least_acceptance_zone,
                                          {0, 1, "", false, true}));
    if (given.has_relaxed_uncertainty_m()) {
      SIGHTLINE_RETURN_IF_ERROR(check.Range("tolerances.relaxed_uncertainty_m",
                                            given.relaxed_uncertainty_m(), kZoneWidth));
      requirements.relaxed_uncertainty_m = given.relaxed_uncertainty_m();
    }
    requirements.file = given.file();
    constexpr int kMaxRegions = 10000;
    if (given.regions_size() > kMaxRegions) {
      return check.Error("tolerances.regions", absl::StrCat("has ", given.regions_size(),
                                                            " entries, at most ", kMaxRegions));
    }
    for (int i = 0; i < given.regions_size(); ++i) {
      absl::StatusOr<TolerancedRegion> region =
          ParseTolerancedRegion(given.regions(i), absl::StrCat("tolerances.regions[", i, "]"),
                                !given.file().empty(), check);
      if (!region.ok()) return region.status();
      requirements.regions.push_back(*std::move(region));
    }
    if (!requirements.zone_width_m && requirements.file.empty() && requirements.regions.empty()) {
      return check.Error("tolerances", "has none of zone_width_m, file, regions");
    }
    inspection->tolerances = std::move(requirements);
  }
  if (inspection->goal.admissible) {
    if (!inspection->uncertainty) {
      return check.Error("uncertainty", "is missing: goal.admissible needs it");
    }
    if (!inspection->tolerances) {
      return check.Error("tolerances", "is missing: goal.admissible needs it");
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Inspection> ParseInspection(const v1::Inspection& given, const std::string& context,
                                           const std::string& base_folder) {
  absl::StatusOr<v1::Inspection> inlined = InlineInspectionFiles(given, context, base_folder);
  if (!inlined.ok()) return inlined.status();
  const v1::Inspection& message = *inlined;
  const Checker check(context);
  Inspection inspection;
  inspection.name = message.name();
  SIGHTLINE_RETURN_IF_ERROR(
      CheckMeshFile(check, "part", message.part().file(), message.part().unit()));
  inspection.part_file = message.part().file();
  inspection.part_unit = message.part().unit();

  absl::StatusOr<Rig> rig =
      ParseRig(message.rig(), message.camera(), message.has_lens() ? &message.lens() : nullptr,
               message.laser(), context);
  if (!rig.ok()) return rig.status();
  inspection.rig = *std::move(rig);

  absl::StatusOr<TargetSampling> targets = ParseTargetSampling(message.targets(), context);
  if (!targets.ok()) return targets.status();
  inspection.targets = *std::move(targets);
  SIGHTLINE_RETURN_IF_ERROR(CheckLimitInputs(inspection.rig, inspection.targets, context));

  absl::StatusOr<MeasurementDomain> domain = ParseMeasurementDomain(message.measurement(), check);
  if (!domain.ok()) return domain.status();
  inspection.domain = *std::move(domain);

  for (int i = 0; i < message.obstacles_size(); ++i) {
    const v1::Obstacle& obstacle = message.obstacles(i);
    const std::string path = absl::StrCat("obstacles[", i, "]");
    SIGHTLINE_RETURN_IF_ERROR(CheckMeshFile(check, path, obstacle.file(), obstacle.unit()));
    ObstacleSource source{obstacle.name(), obstacle.file(), obstacle.unit(), ObstacleFrame::kPart};
    switch (obstacle.frame()) {
      case v1::Obstacle::FRAME_PART:
        source.frame = ObstacleFrame::kPart;
        break;
      case v1::Obstacle::FRAME_STAGE:
        source.frame = ObstacleFrame::kStage;
        break;
      case v1::Obstacle::FRAME_WORLD:
        source.frame = ObstacleFrame::kWorld;
        break;
      default:
        return check.Error(path + ".frame",
                           "is missing, must be FRAME_PART, FRAME_STAGE or FRAME_WORLD");
    }
    inspection.obstacles.push_back(std::move(source));
  }

  absl::StatusOr<PlanningGoal> goal = ParseGoal(message.goal(), check);
  if (!goal.ok()) return goal.status();
  inspection.goal = *goal;
  SIGHTLINE_RETURN_IF_ERROR(ParseUncertaintyGoal(message, check, context, &inspection));
  absl::StatusOr<CostModel> costs = ParseCosts(message.costs(), check);
  if (!costs.ok()) return costs.status();
  inspection.costs = *costs;
  SIGHTLINE_RETURN_IF_ERROR(ParseImaging(message, context, &inspection));
  if (inspection.rig.lens) {
    auto optics = ParseOpticsPlanning(message.optics(), *inspection.rig.lens, context);
    if (!optics.ok()) return optics.status();
    inspection.optics = *std::move(optics);
  } else if (message.has_optics()) {
    return check.Error("optics", "is given without a lens");
  }
  return inspection;
}

absl::StatusOr<Inspection> ReadInspection(const std::string& path) {
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(path, &message));
  return ParseInspection(message, path, std::filesystem::path(path).parent_path().string());
}

Measurement MeasurementFromProto(const v1::Measurement& m) {
  return {m.camera_distance_m(),
          Radians(m.triangulation_angle_deg()),
          Radians(m.camera_azimuth_deg()),
          Radians(m.camera_polar_deg()),
          Radians(m.part_alpha_deg()),
          Radians(m.part_beta_deg()),
          Radians(m.part_gamma_deg()),
          m.offset_y_m(),
          m.offset_z_m()};
}

v1::Measurement MeasurementToProto(const Measurement& m) {
  v1::Measurement message;
  message.set_camera_distance_m(m.camera_distance_m);
  message.set_triangulation_angle_deg(Degrees(m.triangulation_angle_rad));
  message.set_camera_azimuth_deg(Degrees(m.camera_azimuth_rad));
  message.set_camera_polar_deg(Degrees(m.camera_polar_rad));
  message.set_part_alpha_deg(Degrees(m.part_alpha_rad));
  message.set_part_beta_deg(Degrees(m.part_beta_rad));
  message.set_part_gamma_deg(Degrees(m.part_gamma_rad));
  message.set_offset_y_m(m.offset_y_m);
  message.set_offset_z_m(m.offset_z_m);
  return message;
}

v1::Camera CameraToProto(const Camera& camera) {
  v1::Camera message;
  message.set_columns_px(camera.columns_px);
  message.set_rows_px(camera.rows_px);
  message.set_vertical_fov_deg(Degrees(camera.vertical_fov_rad));
  if (camera.pixel_pitch_m) message.set_pixel_pitch_m(*camera.pixel_pitch_m);
  return message;
}

v1::Laser LaserToProto(const Laser& laser) {
  v1::Laser message;
  if (laser.distance_m) message.set_distance_m(*laser.distance_m);
  message.set_fan_angle_deg(Degrees(laser.fan_angle_rad));
  return message;
}

v1::Rig RigToProto(const Rig& rig) {
  v1::Rig message;
  message.set_scan_step_m(rig.scan_step_m);
  message.set_stage_travel_m(rig.stage_travel_m);
  message.set_max_range_m(rig.max_range_m);
  for (const Body& body : rig.camera_bodies) *message.add_camera_bodies() = BodyToProto(body);
  for (const Body& body : rig.laser_bodies) *message.add_laser_bodies() = BodyToProto(body);
  return message;
}

v1::TargetSampling TargetSamplingToProto(const TargetSampling& sampling) {
  v1::TargetSampling message;
  message.set_spacing_m(sampling.spacing_m);
  message.set_coverage_radius_m(sampling.coverage_radius_m);
  message.set_max_normal_angle_deg(Degrees(sampling.max_normal_angle_rad));
  message.set_seed(sampling.seed);
  for (const TargetRegion& region : sampling.regions) {
    v1::TargetRegion* out = message.add_regions();
    out->set_name(region.name);
    *out->mutable_min_m() = FromVector(region.min_m);
    *out->mutable_max_m() = FromVector(region.max_m);
    out->set_spacing_m(region.spacing_m);
    if (region.resolution_m) out->set_resolution_m(*region.resolution_m);
  }
  if (sampling.max_pixel_footprint_m) {
    message.set_max_pixel_footprint_m(*sampling.max_pixel_footprint_m);
  }
  if (sampling.max_circle_of_confusion_px) {
    message.set_max_circle_of_confusion_px(*sampling.max_circle_of_confusion_px);
  }
  return message;
}

}  // namespace sightline
