// SPDX-License-Identifier: Apache-2.0
#include "planner_client/inspection_draft/inspection_draft.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/catalogue/combination.h"
#include "core/inspection/inspection.h"
#include "core/status/status_macros.h"
#include "core/targets/poisson_disk.h"

namespace sightline {
namespace {

// Enough that plans change little with more (docs/proof.md), few enough for seconds.
constexpr double kWishedTargets = 8000;
// The schema's own ratio: 3 mm at a spacing of 5 mm.
constexpr double kRadiusPerSpacing = 0.6;
constexpr double kUsualFNumber = 8;

// To multiples of a power of ten, and so that it is written with few digits: 3 / 1e4 is, 3 * 1e-4
// is not.
double Round2(double value, double step) {
  if (step >= 1) return std::round(value / step) * step;
  const double per_unit = std::round(1 / step);
  return std::round(value * per_unit) / per_unit;
}

// Distance of the camera: one and a half diameters, which fits most stages.
double WorkingDistance(double diameter_m) { return std::clamp(1.5 * diameter_m, 0.2, 0.6); }

std::string SizeText(const PartHealth& health) {
  const Eigen::Vector3d mm = 1e3 * health.bounding_box_m.sizes();
  return absl::StrFormat("%.4g x %.4g x %.4g mm, %d triangles, %.4g cm2", mm.x(), mm.y(), mm.z(),
                         health.triangle_count, 1e4 * health.area_m2);
}

// Chooses the lens whose field of view is nearest to the part's size.
absl::StatusOr<DeviceLens> ChooseLens(const DraftRequest& request, double diameter_m) {
  const double z_m = WorkingDistance(diameter_m);
  const DeviceLens* best = nullptr;
  double best_mismatch = std::numeric_limits<double>::infinity();
  for (const DeviceLens& lens : request.lenses) {
    if (FitOfMounts(lens.mount, request.camera->mount) == MountFit::kDoesNotFit) continue;
    if (!ImageCircleHolds(lens, request.camera->sensor) || !FocusesAt(lens, z_m)) continue;
    const double width_m = FieldOfViewAt(request.camera->sensor, lens.lens, z_m).width_m;
    const double mismatch = std::abs(std::log(width_m / diameter_m));
    if (mismatch < best_mismatch) {
      best = &lens;
      best_mismatch = mismatch;
    }
  }
  if (best != nullptr) return *best;
  return absl::InvalidArgumentError(
      absl::StrFormat("no lens of the catalogue fits %s and focuses at %.0f mm; name one that you "
                      "have with --focal-length-mm",
                      request.camera->sensor.name, 1e3 * z_m));
}

// Checks that the options fit the profile sensor, which has its own camera and laser.
absl::Status CheckProfileSensor(const DraftRequest& request) {
  for (const auto& [given, option] :
       {std::pair(request.camera.has_value(), "--camera"),
        std::pair(request.lens.has_value(), "--lens"),
        std::pair(request.laser.has_value(), "--laser"),
        std::pair(request.columns_px.has_value(), "--columns"),
        std::pair(request.rows_px.has_value(), "--rows"),
        std::pair(request.pixel_pitch_m.has_value(), "--pixel-pitch-um"),
        std::pair(request.vertical_fov_deg.has_value(), "--fov-deg"),
        std::pair(request.focal_length_m.has_value(), "--focal-length-mm"),
        std::pair(request.f_number.has_value(), "--f-number")}) {
    if (!given) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(option, " and --sensor exclude each other: ", request.profile_sensor->name,
                     " has a camera and a laser of its own"));
  }
  if (request.rig.kind != RigKind::kRigid && request.rig.kind != RigKind::kRobot) {
    return absl::InvalidArgumentError("--sensor is for --rig rigid and --rig robot");
  }
  if (request.rig.triangulation_angles_deg.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--triangulation-angle-deg is missing: the catalogue does not have that of ",
                     request.profile_sensor->name, "; ask its maker or measure it on a drawing"));
  }
  if (request.rig.triangulation_angles_deg.size() > 1) {
    return absl::InvalidArgumentError("--sensor takes one --triangulation-angle-deg");
  }
  return absl::OkStatus();
}

absl::Status CheckDevices(const DraftRequest& request) {
  if (request.profile_sensor) return CheckProfileSensor(request);
  const auto refuse = [](const char* option, const char* device) {
    return absl::InvalidArgumentError(
        absl::StrCat(option, " is that of the ", device, " already: give one of the two"));
  };
  if (request.camera) {
    if (request.columns_px) return refuse("--columns", "camera");
    if (request.rows_px) return refuse("--rows", "camera");
    if (request.pixel_pitch_m) return refuse("--pixel-pitch-um", "camera");
    if (request.vertical_fov_deg) return refuse("--fov-deg", "camera with its lens");
  }
  if (request.lens && request.focal_length_m) return refuse("--focal-length-mm", "lens");
  if (request.f_number && !request.lens && !request.camera && !request.focal_length_m) {
    return absl::InvalidArgumentError("--f-number needs a lens: give --focal-length-mm or --lens");
  }
  if (NeedsPixelPitch(request)) {
    return absl::InvalidArgumentError(
        "--pixel-pitch-um is missing: with --rows and the lens's focal length it gives the field "
        "of "
        "view; or give --fov-deg");
  }
  return absl::OkStatus();
}

void DraftLens(const DeviceLens& lens, double f_number, v1::Lens* to) {
  const v1::CatalogueLens& from = lens.message;
  to->set_focal_length_m(from.focal_length_m());
  to->set_f_number(std::clamp(f_number, lens.min_f_number, lens.max_f_number));
  if (from.has_transmission()) to->set_transmission(from.transmission());
  if (from.has_aperture_blades()) to->set_aperture_blades(from.aperture_blades());
  if (from.has_distortion()) *to->mutable_distortion() = from.distortion();
  to->set_min_f_number(lens.min_f_number);
  to->set_max_f_number(lens.max_f_number);
  if (lens.min_focus_distance_m) to->set_min_focus_distance_m(*lens.min_focus_distance_m);
}

absl::Status DraftOptics(const DraftRequest& request, double diameter_m, InspectionDraft* draft) {
  v1::Inspection& inspection = draft->inspection;
  v1::Camera& camera = *inspection.mutable_camera();
  const double f_number = request.f_number.value_or(kUsualFNumber);
  if (request.camera) {
    camera.set_sensor_file(request.camera_file);
    draft->comments["camera"] = absl::StrCat(request.camera->sensor.name, ".");
    if (!request.lens && !request.focal_length_m) {
      SIGHTLINE_ASSIGN_OR_RETURN(auto lens, ChooseLens(request, diameter_m));
      draft->lens = lens.name;
      DraftLens(lens, f_number, inspection.mutable_lens());
      draft->comments["lens"] = absl::StrCat(
          lens.name,
          ": of the catalogue's lenses that fit the camera, the one whose field of view "
          "is nearest to the part's size. Field of view by camera and lens.");
    }
  } else {
    camera.set_columns_px(request.columns_px.value_or(512));
    camera.set_rows_px(request.rows_px.value_or(512));
    if (request.pixel_pitch_m) camera.set_pixel_pitch_m(*request.pixel_pitch_m);
    double fov_deg = request.vertical_fov_deg.value_or(45);
    const std::optional<double> focal_length_m =
        request.lens ? request.lens->message.focal_length_m() : request.focal_length_m;
    const bool from_lens = !request.vertical_fov_deg && request.pixel_pitch_m && focal_length_m;
    if (from_lens) {
      fov_deg = 2 * std::atan(0.5 * camera.rows_px() * *request.pixel_pitch_m / *focal_length_m) *
                180 / std::numbers::pi;
      fov_deg = Round2(fov_deg, 1e-3);
    }
    camera.set_vertical_fov_deg(fov_deg);
    draft->comments["camera"] =
        request.columns_px || request.rows_px || request.vertical_fov_deg || from_lens
            ? "Size of the image and vertical field of view."
            : "No camera was named: a small image with a wide view. Put your own numbers here, or "
              "name a camera file: \"sensor_file\".";
  }
  if (request.lens) {
    DraftLens(*request.lens, f_number, inspection.mutable_lens());
    draft->comments["lens"] = absl::StrCat(request.lens->name, ".");
  } else if (request.focal_length_m) {
    inspection.mutable_lens()->set_focal_length_m(*request.focal_length_m);
    inspection.mutable_lens()->set_f_number(f_number);
  }
  if (request.laser) {
    *inspection.mutable_laser() = request.laser->message.laser();
    draft->comments["laser"] = absl::StrCat(request.laser->name, ".");
  } else {
    inspection.mutable_laser()->set_fan_angle_deg(90);
    draft->comments["laser"] = "Full angle of the laser's fan.";
  }
  return absl::OkStatus();
}

// Camera and laser equivalent to the profile sensor. Line of sight and laser plane meet in the
// middle of the range, at the distance d = middle / cos(tau) from the camera. A point
// of the laser's axis that is s nearer to the laser than that is seen off the camera's axis by
//   tan = s sin(tau) / (d - s cos(tau)),
// and the image has as many rows as the ends of the range need.
void DraftProfileSensor(const DeviceProfileSensor& sensor, double tau_rad, InspectionDraft* draft) {
  v1::Inspection& inspection = draft->inspection;
  const double distance_m = sensor.MiddleDistance() / std::cos(tau_rad);
  const double half_range_m = 0.5 * (sensor.far_distance_m - sensor.near_distance_m);
  const double focal_length_px = sensor.points_per_profile * distance_m / sensor.MiddleWidth();
  const auto tangent = [&](double s_m) {
    return std::abs(s_m) * std::sin(tau_rad) / (distance_m - s_m * std::cos(tau_rad));
  };
  const double half_rows_px =
      std::ceil(focal_length_px * std::max(tangent(half_range_m), tangent(-half_range_m)));
  v1::Camera& camera = *inspection.mutable_camera();
  camera.set_columns_px(sensor.points_per_profile);
  camera.set_rows_px(std::max(16, static_cast<int>(2 * half_rows_px)));
  camera.set_vertical_fov_deg(Round2(
      2 * std::atan(0.5 * camera.rows_px() / focal_length_px) * 180 / std::numbers::pi, 1e-6));
  draft->comments["camera"] =
      absl::StrCat(sensor.name, ", range ", Round2(1e3 * sensor.near_distance_m, 1e-3), " to ",
                   Round2(1e3 * sensor.far_distance_m, 1e-3),
                   " mm: a camera that measures the same. Its bodies are not in the catalogue: "
                   "rig.camera_bodies and laser_bodies have their defaults.");
  v1::Laser& laser = *inspection.mutable_laser();
  laser.set_fan_angle_deg(Round2(
      2 * std::atan(0.5 * sensor.far_width_m / sensor.far_distance_m) * 180 / std::numbers::pi,
      1e-3));
  if (sensor.wavelength_m) laser.set_wavelength_m(*sensor.wavelength_m);
  draft->comments["laser"] = "Fan that is as wide as the line at the end of the range.";
  // The far corner of the range.
  inspection.mutable_rig()->set_max_range_m(
      Round2(std::hypot(half_range_m * std::sin(tau_rad),
                        distance_m + half_range_m * std::cos(tau_rad), 0.5 * sensor.far_width_m),
             1e-4));
}

void DraftGoal(const DraftRequest& request, InspectionDraft* draft) {
  v1::Inspection& inspection = draft->inspection;
  v1::PlanningGoal& goal = *inspection.mutable_goal();
  if (!request.tolerance_m && request.tolerance_file.empty()) {
    goal.set_coverage(request.goal);
    draft->comments["goal"] =
        request.tolerances_in_part > 0
            ? absl::StrCat(
                  "Enough scans that this fraction of the measurable targets is covered. "
                  "The STEP file states ",
                  request.tolerances_in_part,
                  " tolerances: `sightline new ... --tolerances part` plans until the "
                  "surface is known well enough for them.")
            : "Enough scans that this fraction of the measurable targets is covered.";
    return;
  }
  goal.set_admissible(request.goal);
  draft->comments["goal"] =
      "Enough scans that this fraction of the measurable targets is known well enough for its "
      "tolerance.";
  v1::Uncertainty& uncertainty = *inspection.mutable_uncertainty();
  uncertainty.mutable_line_detection()->set_standard_deviation_px(0.2);
  uncertainty.set_prior_standard_deviation_m(0.01);
  uncertainty.set_resolution_m(inspection.targets().coverage_radius_m());
  draft->comments["uncertainty"] =
      "Errors of the measurement: of the laser line's centre in the image, and of the surface "
      "about "
      "the CAD model before any scan; lateral resolution to which the surface is to be known. A "
      "calibration is assumed until yours is stated, and set-ups are joined by best fit "
      "(docs/plan-for-uncertainty.md).";
  v1::ToleranceRequirements& tolerances = *inspection.mutable_tolerances();
  if (request.tolerance_m) {
    tolerances.set_zone_width_m(*request.tolerance_m);
    draft->comments["tolerances.zone_width_m"] =
        "Full width of the tolerance zone of all that has no tolerance of its own.";
  }
  if (!request.tolerance_file.empty()) tolerances.set_file(request.tolerance_file);
  tolerances.set_unit(request.tolerance_unit);
}

// Writes the offsets that the part's size allows if they are below Table 2.1. They equal the
// defaults; written out, users with a narrower stage find them.
void DraftDomain(double diameter_m, InspectionDraft* draft) {
  const LargestOffset largest = LargestOffsetOf(diameter_m);
  if (!largest.below_table_2_1) return;
  v1::MeasurementDomain& domain = *draft->inspection.mutable_measurement();
  const auto within = [](v1::ParameterDomain& parameter, double largest_m) {
    v1::ParameterDomain::Range& range = *parameter.add_ranges();
    range.set_min(-largest_m);
    range.set_max(largest_m);
  };
  within(*domain.mutable_offset_y_m(), largest.y_m);
  within(*domain.mutable_offset_z_m(), largest.z_m);
  draft->comments["measurement"] =
      "What scans may be. The part is shifted by its own size at the most.";
}

}  // namespace

bool NeedsPixelPitch(const DraftRequest& request) {
  return !request.camera && !request.pixel_pitch_m && !request.vertical_fov_deg &&
         (request.lens || request.focal_length_m);
}

double SpacingFor(double area_m2) {
  const double wished_m = std::sqrt(kTargetsPerSpacing2 * area_m2 / kWishedTargets);
  const double power = std::pow(10.0, std::floor(std::log10(std::max(wished_m, 1e-9))));
  double best = power;
  for (const double mantissa : {1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0}) {
    if (std::abs(std::log(mantissa * power / wished_m)) < std::abs(std::log(best / wished_m))) {
      best = mantissa * power;
    }
  }
  return std::clamp(Round2(best, 1e-5), 1e-4, 0.1);
}

absl::StatusOr<InspectionDraft> DraftInspection(const DraftRequest& request) {
  SIGHTLINE_RETURN_IF_ERROR(CheckDevices(request));
  InspectionDraft draft;
  v1::Inspection& inspection = draft.inspection;
  FieldComments& comments = draft.comments;
  const double diameter_m = request.health.bounding_box_m.sizes().norm();
  comments[""] =
      "Written by `sightline new`; yours to change. Lengths are in metres, angles in degrees; what "
      "is left out has its default. Comments go from two slashes to the end of the line. All "
      "fields: docs/plan-a-part.md.";
  inspection.set_name(request.name);
  inspection.set_defaults(kCurrentDefaults);
  comments["defaults"] = "Of fields that are not here: those of this version.";
  inspection.mutable_part()->set_file(request.part_file);
  inspection.mutable_part()->set_unit(request.part_unit);
  if (request.construction_geometry) inspection.mutable_part()->set_construction_geometry(true);
  comments["part"] = absl::StrCat(SizeText(request.health), ".");

  v1::TargetSampling& targets = *inspection.mutable_targets();
  const double spacing_m = request.spacing_m.value_or(SpacingFor(request.health.area_m2));
  const double radius_m = Round2(kRadiusPerSpacing * spacing_m, 1e-5);
  targets.set_spacing_m(spacing_m);
  targets.set_coverage_radius_m(radius_m);
  const double expected =
      std::max(1.0, kTargetsPerSpacing2 * request.health.area_m2 / (spacing_m * spacing_m));
  draft.expected_targets =
      std::llround(Round2(expected, std::pow(10.0, std::floor(std::log10(expected)) - 1)));
  comments["targets"] = absl::StrFormat(
      "About %d points on the surface, so far apart; one is covered by a measured point within "
      "the coverage radius.",
      draft.expected_targets);
  for (v1::TargetRegion& region : SampleFeatures(request.toleranced_surfaces, spacing_m)) {
    *targets.add_regions() = std::move(region);
  }
  if (targets.regions_size() > 0) {
    comments["targets.regions"] =
        absl::StrFormat("Surfaces of tolerances and datums that would have fewer than %d points.",
                        kWishedFeatureTargets);
  }

  v1::Rig& rig = *inspection.mutable_rig();
  rig.set_part_holding(request.holding);
  comments["rig.part_holding"] =
      "PART_HOLDING_RESTING: lies on the table, on a face on which it is stable. "
      "PART_HOLDING_FIXTURE: clamped as in the CAD file. PART_HOLDING_FREE: in any orientation.";
  // A step of a third of the radius leaves no target between two frames.
  rig.set_scan_step_m(std::clamp(Round2(radius_m / 3, 1e-5), 5e-5, 1e-3));
  comments["rig.scan_step_m"] = "Stage travel from frame to frame, and the longest of one scan.";
  // The sheet passes over the part at a slant: about twice its diameter at 60 degrees.
  rig.set_stage_travel_m(std::clamp(std::ceil(20 * diameter_m) / 10, 1.0, 20.0));

  DraftDomain(diameter_m, &draft);
  absl::Status status;
  if (request.profile_sensor) {
    DraftProfileSensor(*request.profile_sensor,
                       request.rig.triangulation_angles_deg.front() * std::numbers::pi / 180,
                       &draft);
  } else {
    status = DraftOptics(request, diameter_m, &draft);
  }
  if (!status.ok()) return status;
  status = DraftRig(request.rig, request.health, &inspection, &comments);
  if (!status.ok()) return status;
  DraftGoal(request, &draft);
  return draft;
}

}  // namespace sightline
