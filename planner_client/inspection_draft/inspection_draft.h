// SPDX-License-Identifier: Apache-2.0
// Drafts a first inspection.json for a part: the engineer's values, and defaults derived from the
// part's size.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/catalogue/catalogue.h"
#include "core/part/part_health.h"
#include "planner_client/inspection_draft/commented_json.h"
#include "planner_client/inspection_draft/feature_sampling.h"
#include "planner_client/inspection_draft/rig_draft.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// Known facts and wishes. File names are those to be written into the inspection.
struct DraftRequest {
  std::string name;
  std::string part_file, part_unit;
  bool construction_geometry =
      false;  // of a STEP file: use construction geometry as part of the part
  PartHealth health;
  v1::Rig::PartHolding holding = v1::Rig::PART_HOLDING_RESTING;
  RigWish rig;

  // Devices of a catalogue; `camera_file` is the camera's file. For a camera without a lens, the
  // lens that suits the part best is chosen.
  std::optional<DeviceCamera> camera;
  std::string camera_file;
  std::optional<DeviceLens> lens;
  std::optional<DeviceLaser> laser;
  std::vector<DeviceLens> lenses;  // to choose from
  // Replaces these three by one housing with camera and laser; `rig` has its stand-off and angle.
  std::optional<DeviceProfileSensor> profile_sensor;

  // Single numbers in place of catalogue devices.
  std::optional<int> columns_px, rows_px;
  std::optional<double> pixel_pitch_m, vertical_fov_deg, focal_length_m, f_number;

  std::optional<double> spacing_m;
  double goal = 0.95;
  // Full width of the tolerance of the whole surface; set: a plan for uncertainty.
  std::optional<double> tolerance_m;
  // STEP or QIF file with the tolerances of the drawing; set: a plan for uncertainty.
  std::string tolerance_file;
  std::string tolerance_unit;  // of that file, if it states none
  // Faces that its tolerances and datums bind; empty where the file gives no surfaces.
  std::vector<TolerancedSurface> toleranced_surfaces;
  // Number of tolerances in the part's STEP file, for a hint; 0: none, or not examined.
  int tolerances_in_part = 0;
};

struct InspectionDraft {
  v1::Inspection inspection;
  FieldComments comments;
  int64_t expected_targets = 0;  // rounded to two digits
  std::string lens;              // name of the one that was chosen from `lenses`
};

// True if a lens is given but nothing determines the camera's field of view: no camera of a
// catalogue, no pixel pitch, no field of view.
bool NeedsPixelPitch(const DraftRequest& request);

// INVALID_ARGUMENT if no lens suits the camera, if numbers are given in addition to a catalogue's
// device, or if NeedsPixelPitch.
absl::StatusOr<InspectionDraft> DraftInspection(const DraftRequest& request);

// Distance between targets at which a part of this area has about 8000 of them, rounded to 1, 1.5,
// 2, 3, 5 or 7 times a power of ten, in [0.0001, 0.1] m.
double SpacingFor(double area_m2);

}  // namespace sightline
