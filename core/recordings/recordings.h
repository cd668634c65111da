// SPDX-License-Identifier: Apache-2.0
// recordings.json: images of a laser line and the nominal description of rig and settings
// (docs/recordings.md). Version 1: a flat plate; version 2: a part; version 3: a flat plate in a
// pose for each recording.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/plate_line/plate_line.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "core/sensor/sensor.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

enum class RecordingKind {
  kLaser,    // laser on
  kDark,     // no light whatever
  kAmbient,  // laser off, other light as described
};

// Lambert + GGX with Schlick's Fresnel term, everywhere on the plate.
struct RecordedSurface {
  double diffuse_albedo = 0;  // rho
  double specular_f0 = 0;     // F0
  double ggx_alpha = 0;       // alpha
};

// A number for every quantity of the set-up that has an uncertainty: the standard uncertainties
// themselves (k = 1), or true minus nominal values. X_relative is a fraction of X.
struct SetupDeviation {
  double camera_distance_m = 0;
  double focus_distance_relative = 0;
  double f_number_relative = 0;
  double laser_distance_m = 0;
  double beam_focus_distance_m = 0;
  double incidence_angle_rad = 0;
  double divergence_relative = 0;
  double power_relative = 0;
  double transmission_relative = 0;
  double diffuse_albedo_relative = 0;
  double specular_f0_relative = 0;
  double ggx_alpha_relative = 0;
  double quantum_efficiency_relative = 0;
  double gain_relative = 0;
  double dark_mean_electrons = 0;
  double dark_noise_relative = 0;
  double line_position_common_px = 0;
  double line_position_each_px = 0;  // a standard deviation: drawn for every plate position
};

// Part of an image file, relative to the middle of the sensor as RecordedImage has it.
struct ImagePart {
  std::string file;
  int column_px = 0, row_px = 0, columns_px = 0, rows_px = 0;
};

// One image. For parts the fields from camera_distance_m to line_offset_m follow from the
// measurement, and plate_position_id is unset.
struct RecordedImage {
  std::string file;  // path in the set's folder; relative, without ".."
  RecordingKind kind = RecordingKind::kLaser;
  double timestamp_s = 0;  // start of exposure since the laser was switched on
  std::string series;
  std::optional<int> plate_position_id;  // unset for dark frames
  bool same_speckle = false;
  int burst_frame_index = 0;
  double exposure_time_s = 0;
  double f_number = 0;
  double camera_distance_m = 0;
  double focus_distance_m = 0;
  double laser_distance_m = 0;
  double line_offset_m = 0;
  int roi_column_px = 0;  // relative to the principal point
  int roi_row_px = 0;
  int roi_columns_px = 0;
  int roi_rows_px = 0;
  int repeat_group = 0;
  // Version 2.
  Measurement measurement;
  int scan = 0;
  int frame = 0;
  double stage_position_m = 0;
  // Version 3. Laser recordings have a pose, which takes points of the plate to camera coordinates.
  std::optional<Eigen::Isometry3d> plate_in_camera;
  // Version 3 after its reduction to version 1 (core/recordings/reduction).
  std::optional<ObliqueView> view;
  std::optional<ImagePart> part_of_image;
};

// Version 3: what all poses refer to.
struct PosedPlates {
  TargetCamera camera;  // pixels of the sensor, counted from its first
  LaserSheet sheet;
  bool transposed = false;  // reduced recordings of lines along the columns of the sensor
};

// Version 2: what the images show.
struct RecordedPart {
  std::string file;
  std::string part_digest;
  Lens lens;
  Laser laser;
  std::vector<v1::MaterialAssignment> materials;
  v1::Lighting lighting;
};

struct RecordingSet {
  int format_version = 1;
  std::string name;
  Sensor camera;
  double focal_length_m = 0;
  double transmission = 1;
  Laser laser;  // of version 1: Powell profile, distance unset (every recording has its own)
  RecordedSurface surface;                // version 1
  double incidence_angle_rad = 0;         // version 1; between laser sheet and plate normal
  SetupDeviation uncertainty;             // all 0 if not given
  std::vector<RecordedImage> recordings;  // in order of time
  std::optional<RecordedPart> part;       // version 2
  std::optional<PosedPlates> posed;       // version 3, also after its reduction

  // Angle between the light and the plate's normal.
  double IncidenceAngle(const RecordedImage& image) const {
    return image.view ? image.view->incidence_angle_rad : incidence_angle_rad;
  }
};

// INVALID_ARGUMENT names `context` (e.g. the file name), field path, value and allowed range: a
// missing field, a region outside the sensor, a file name that leaves the folder or is used twice,
// a recording before the one it follows, ...
absl::StatusOr<RecordingSet> ParseRecordings(const v1::Recordings& message,
                                             const std::string& context);

// JSON in which a null `plate_position_id` (a dark frame: the plate was nowhere) stands as the
// number that messages have for it.
std::string NumberNullPlatePositions(std::string json);

// JSON form of the message; `plate_position_id` may be null. INVALID_ARGUMENT for unknown fields,
// naming the nearest known one; NOT_FOUND if the file cannot be read.
absl::Status ReadRecordingsMessage(const std::string& path, v1::Recordings* message);
absl::StatusOr<RecordingSet> ReadRecordings(const std::string& path);

// The inverse of ParseRecordings. Quantities that version 1 does not know are left out where they
// have the value the null model gives them.
v1::Recordings RecordingsToProto(const RecordingSet& set);
// Text of recordings.json. plate_position_id of dark frames on plates is null.
std::string RecordingsToJson(const v1::Recordings& message);

absl::StatusOr<SetupDeviation> ParseSetupDeviation(const v1::Recordings::Uncertainty& message,
                                                   bool may_be_negative, const std::string& path,
                                                   const std::string& context);

}  // namespace sightline
