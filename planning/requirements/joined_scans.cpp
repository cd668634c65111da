// SPDX-License-Identifier: Apache-2.0
#include "planning/requirements/joined_scans.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/physics/angle.h"
#include "core/rig/scan_geometry.h"
#include "core/surface_inference/surface_inference.h"
#include "planning/strategy/execution/execution_model.h"

namespace sightline {
namespace {

// The targets that a scan informs about, with their derivatives.
ScanShare ShareOf(const Rig& rig, const Measurement& scan, const Eigen::Vector3d& part_centre_m,
                  const TargetSet& targets, const std::vector<float>& density) {
  const ScanGeometry geometry = MakeScanGeometry(rig, scan);
  ScanShare share;
  for (size_t t = 0; t < density.size(); ++t) {
    if (!(density[t] > 0)) continue;
    const Eigen::Vector3d position = targets.positions_m[t].cast<double>();
    const double stage_m =
        geometry.LitStagePosition(PartToWorld(geometry, part_centre_m, position, 0));
    const TriangulationSetup setup = MakeTriangulationSetup(
        rig.camera, WorldToPart(geometry, part_centre_m, geometry.camera, stage_m),
        WorldToPart(geometry, part_centre_m, geometry.laser, stage_m));
    share.targets.push_back(static_cast<uint32_t>(t));
    share.information.push_back(density[t]);
    share.derivatives.push_back(
        CalibrationDerivatives(setup, position, targets.normals[t].cast<double>()).cast<float>());
  }
  return share;
}

// Targets on the datum features.
std::vector<bool> OnDatums(const Requirements& requirements, const TargetSet& targets) {
  std::vector<bool> on(targets.size(), false);
  for (size_t t = 0; t < targets.size(); ++t) {
    on[t] = std::any_of(requirements.datum_faces.begin(), requirements.datum_faces.end(),
                        [&](const FaceSurface& face) {
                          return face.Contains(targets.positions_m[t].cast<double>(),
                                               targets.normals[t].cast<double>());
                        });
  }
  return on;
}

// `sensors_move`: the sensors change their place, so errors of placing them count too.
PoseDeviations PoseBefore(const Inspection& inspection, RegistrationMethod method,
                          bool sensors_move) {
  if (method == RegistrationMethod::kKnownPoses) {
    return {inspection.uncertainty->registration_angle_rad,
            inspection.uncertainty->registration_position_m};
  }
  const PlacementErrors& placement = inspection.placement;
  if (!sensors_move) return {placement.part_angle_rad, placement.part_position_m};
  return {std::hypot(placement.part_angle_rad, placement.sensor_angle_rad),
          std::hypot(placement.part_position_m, placement.sensor_position_m)};
}

}  // namespace

bool HasSharedErrors(const Inspection& inspection) {
  return inspection.uncertainty->HasCalibrationErrors() ||
         inspection.uncertainty->registration != RegistrationMethod::kNone;
}

SharedErrors SharedErrorsOf(const Inspection& inspection, const Requirements& requirements,
                            std::span<const Measurement> scans,
                            const Eigen::Vector3d& part_centre_m, const PlanKnowledge& knowledge,
                            RegistrationMethod method) {
  const UncertaintyModel& model = *inspection.uncertainty;
  const ExecutionModel execution = ExecutionModelOf(inspection);
  const bool robot = execution.robot_holds_head || execution.robot_holds_part;
  const bool one_head =
      inspection.sensor_mount == SensorMount::kRigid || execution.robot_holds_head;
  const TargetSet& targets = *knowledge.targets;
  SharedErrorsInput input;
  input.positions_m = targets.positions_m;
  input.normals = targets.normals;
  size_t place = 0, frame = 0;
  bool sensors_move = execution.robot_holds_head;
  for (size_t s = 0; s < scans.size(); ++s) {
    if (s > 0) {
      const bool same_place = SamePlaceOfSensors(execution, scans[s - 1], scans[s]);
      sensors_move = sensors_move || !same_place;
      if (!same_place && !one_head) ++place;
      if (robot || !same_place || !SameRest(execution, scans[s - 1], scans[s])) ++frame;
    }
    ScanShare& share = input.scans.emplace_back(
        ShareOf(inspection.rig, scans[s], part_centre_m, targets, knowledge.density[s]));
    share.place = place;
    share.frame = frame;
  }
  input.calibration =
      model.calibration.bottomRightCorner<kCalibrationVariables, kCalibrationVariables>();
  input.method = method;
  input.pose = PoseBefore(inspection, method, sensors_move);
  for (const SurfaceUncertainty& u : knowledge.uncertainty) {
    input.independent_m2.push_back(u.noise_m * u.noise_m + u.sampling_m * u.sampling_m);
  }
  // See Feature::correlation_length_m.
  input.correlation_length_m = 2 * CovarianceLengthScale(model.resolution_m);
  if (method == RegistrationMethod::kDatumFeatures) input.used = OnDatums(requirements, targets);
  return SharedErrors(std::move(input));
}

std::string RegistrationStatement(const Inspection& inspection, const SharedErrors& errors) {
  const RegistrationMethod method = inspection.uncertainty->registration;
  if (method == RegistrationMethod::kNone) {
    return "The pose of the part is taken as exact in every set-up (uncertainty.registration "
           "NONE).";
  }
  const std::vector<FrameRegistration>& frames = errors.frames();
  if (frames.size() < 2 && method != RegistrationMethod::kKnownPoses) {
    return "All scans are made in one set-up: no registration is needed, and all are fitted to the "
           "model together.";
  }
  double least_m = std::numeric_limits<double>::infinity(), largest_m = 0;
  int undetermined = 0, unjoined = 0;
  for (const FrameRegistration& frame : frames) {
    if (frame.targets == 0) continue;
    if (!frame.joined) {
      ++unjoined;
      continue;
    }
    least_m = std::min(least_m, frame.standard_uncertainty_m);
    largest_m = std::max(largest_m, frame.standard_uncertainty_m);
    undetermined += !frame.determined;
  }
  const char* by = "whose poses are known otherwise";
  if (method == RegistrationMethod::kBestFit) {
    by = "which are joined by best fit over the surface they share";
  } else if (method == RegistrationMethod::kDatumFeatures) {
    by = "which are joined by best fit over the datum features they share";
  }
  std::string text = absl::StrFormat("The scans have %d coordinate system%s, %s", frames.size(),
                                     frames.size() == 1 ? "" : "s", by);
  if (std::isfinite(least_m)) {
    absl::StrAppendFormat(
        &text, ", with standard uncertainties of %.3g to %.3g um along the surface's normals",
        1e6 * least_m, 1e6 * largest_m);
  }
  text += '.';
  if (unjoined > 0) {
    absl::StrAppendFormat(&text,
                          " %d of them share no such surface with another one and are not joined: "
                          "between these and the others the errors of placing the part remain.",
                          unjoined);
  }
  if (undetermined > 0) {
    absl::StrAppendFormat(
        &text,
        " %d of them share too little surface with the others to be joined better "
        "than the part is placed.",
        undetermined);
  }
  return text;
}

std::string CalibrationStatement(const Inspection& inspection) {
  const UncertaintyModel& model = *inspection.uncertainty;
  if (!model.HasCalibrationErrors()) {
    return "Errors of the calibration are not counted (uncertainty.calibration is empty).";
  }
  if (!model.calibration_assumed) return "Errors of the calibration are those that are stated.";
  return "No calibration is stated: a rig calibrated on site is assumed, with 0.001 degrees and "
         "0.01 "
         "mm for camera and laser (uncertainty.calibration).";
}

}  // namespace sightline
