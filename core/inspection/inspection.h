// SPDX-License-Identifier: Apache-2.0
// inspection.json as validated values: SI units, radians, defaults filled in.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/association/association.h"
#include "core/detectability/detectability.h"
#include "core/inspection/optics_planning.h"
#include "core/inspection/robot_mount.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "core/sensor/sensor.h"
#include "core/targets/target_set.h"
#include "core/uncertainty/uncertainty_model.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// The values that one parameter may take. One fixed value is a list of one.
struct ParameterDomain {
  struct Range {
    double min;
    double max;
  };
  // Exactly one of the two is non-empty. Ranges are sorted and do not overlap.
  std::vector<Range> ranges;
  std::vector<double> values;
  // Angle that wraps around at a full turn (azimuth, alpha, beta, gamma).
  bool periodic = false;

  bool Contains(double value) const;  // within 1e-9
};

struct RestingOrientation {
  double part_alpha_rad;
  double part_beta_rad;
  std::string name = "";  // for people: the part's support
};

// Same order as Measurement; angles in radians.
struct MeasurementDomain {
  std::array<ParameterDomain, kMeasurementParameters> parameters;
  std::vector<RestingOrientation> resting_orientations;

  bool Contains(const Measurement& measurement) const;
};

// Bounds of Table 2.1.
MeasurementDomain ThesisDomain();

// Default limit on the shift of a part from the point where line of sight and laser meet: its own
// diameter (diagonal of the bounding box), rounded up to whole centimetres, within Table 2.1. Scans
// with a larger shift do not see a small part.
struct LargestOffset {
  double y_m, z_m;
  bool below_table_2_1;  // of y or z
};
LargestOffset LargestOffsetOf(double part_diameter_m);

enum class ObstacleFrame { kPart, kStage, kWorld, kTable };

// The way in which the part is held (v1::Rig::PartHolding).
enum class PartHolding { kResting, kFixture, kFree };

// Box on which a resting part lies; unset sizes follow from the part.
struct TableSize {
  std::optional<double> size_x_m, size_y_m;
  double thickness_m = 0.02;
};

struct ObstacleSource {
  std::string name;
  std::string file;  // absolute, or relative to the working directory
  std::string unit;
  ObstacleFrame frame;
};

// Weights of the gain of a target (v1::GainWeights).
struct GainWeights {
  double coverage = 0;
  double admissible = 0;
  double relaxed = 0;
  double information = 0;
  double total_uncertainty = 0;
};

struct PlanningGoal {
  double coverage = 0.95;  // 0: no goal of coverage
  int max_scans = 40;
  std::optional<double> max_time_s;
  double min_gain = 0.0002;
  // Fraction of the toleranced targets that need an admissible uncertainty; set: uncertainty goal.
  std::optional<double> admissible;
  GainWeights gain{.admissible = 0.5, .information = 0.5};
  // Limits on executing the plan; unset: none. The time is that of its cost.
  std::optional<double> execution_time_s;
  std::optional<int> max_setups, max_sensor_places, max_resting_faces;

  bool LimitsExecution() const {
    return execution_time_s || max_setups || max_sensor_places || max_resting_faces;
  }
};

// A surface with a tolerance: exactly one of box, materials, faces is given.
struct TolerancedRegion {
  std::string name;
  double zone_width_m = 0;                   // full width
  std::optional<Eigen::AlignedBox3d> box_m;  // part coordinates
  std::vector<std::string> materials;
  std::vector<int> faces;  // of the STEP file, from 1
};

// Required certainty of the surface (v1::ToleranceRequirements).
struct ToleranceRequirements {
  std::optional<double> zone_width_m;  // for targets without another tolerance; unset: none
  double guard_factor = 2;
  double least_acceptance_zone = 0;  // fraction of the zone's width
  std::optional<double> relaxed_uncertainty_m;
  std::string file;  // STEP or QIF, resolved; empty: none
  // Unit of lengths in a file that states none, as LengthUnitNamed gives it; the part's unit where
  // the file is the part's own. Empty: the file must state it.
  std::string file_unit;
  std::vector<TolerancedRegion> regions;
  Association association = Association::kGauss;
};

struct CostModel {
  std::optional<double> stage_speed_m_per_s;
  std::optional<double> frame_rate_hz;
  std::optional<double> reposition_time_s;
  std::optional<double> reposition_speed_rad_per_s;
  std::optional<double> reposition_speed_m_per_s;
  // Times for laying the part on another face, turning or shifting it, and moving the sensors.
  double lay_time_s = 0;
  double turn_time_s = 0;
  double move_sensors_time_s = 0;

  // True if no field is set: every scan costs 1.
  bool IsUnit() const;
  // Whether set-ups cost time, so that their number matters.
  bool PricesSetups() const { return lay_time_s > 0 || move_sensors_time_s > 0; }
};

// Standard deviations of the placement errors of part and sensors (v1::Placement).
struct PlacementErrors {
  double part_position_m = 0, part_angle_rad = 0;
  double sensor_position_m = 0, sensor_angle_rad = 0;

  bool AreZero() const {
    return part_position_m == 0 && part_angle_rad == 0 && sensor_position_m == 0 &&
           sensor_angle_rad == 0;
  }
};

// How camera and laser are held (v1::Rig::SensorMount).
enum class SensorMount { kSeparate, kRigid };

// Version of the defaults of fields without a value (v1::Inspection::defaults).
enum class DefaultsVersion { k0_1, k0_2 };
inline constexpr char kCurrentDefaults[] = "0.2";

// The material of one surface of the part.
struct MaterialChoice {
  std::string part_material;  // name in the part file; empty: every surface not named elsewhere
  v1::Material material;      // file names are resolved; its numbers are checked by the renderer
};

// How images are made (see render.proto).
struct RenderSettings {
  double exposure_time_s = 0.01;
  int64_t seed = 1;
  int sub_pixels = 0;  // per pixel and axis; 0: as many as the pupil needs
  double noise_target_relative = 0.02;
  int max_samples_per_px = 512;
  int max_bounces = 4;
  bool laser_interreflection = true;
  double stage_speed_m_per_s = 0;
  std::optional<double> sensor_temperature_c;  // unset: reference temperature of the dark current
  int speckle_patterns = 1;
  bool speckle = true;
};

// A physical effect of the renderer's vocabulary, which checks ids, names and bounds.
struct EffectChoice {
  std::string id;
  std::map<std::string, double> parameters;
};

struct Inspection {
  std::string name;
  std::string part_file;  // resolved against the inspection file's folder
  std::string part_unit;
  bool part_construction_geometry = false;  // of a STEP file
  Rig rig;
  DefaultsVersion defaults = DefaultsVersion::k0_2;
  SensorMount sensor_mount = SensorMount::kSeparate;
  bool stage_moves_in_height = true;
  // A resting part is kFree until HoldPart (part_holding.h) has found its faces.
  PartHolding part_holding = PartHolding::kFree;
  TableSize table;
  TargetSampling targets;
  std::optional<double> required_resolution_m;  // DeriveLimits
  // Offsets that are not given: Table 2.1 until HoldPart limits them to LargestOffsetOf the part.
  MeasurementDomain domain;
  bool offset_y_given = true, offset_z_given = true;
  std::vector<ObstacleSource> obstacles;
  std::optional<RobotMount> robot;  // unset: scans are set up by hand
  PlanningGoal goal;
  PlacementErrors placement;  // all 0 by the defaults "0.1"
  CostModel costs;            // with the defaults of `defaults`
  // The stated costs, without defaults: a default speed has a cost but does not limit exposures.
  CostModel stated_costs;
  std::optional<UncertaintyModel> uncertainty;
  std::optional<ToleranceRequirements> tolerances;
  // Inputs of image rendering; planning does not read these.
  std::optional<Sensor> sensor;
  // Range of exposure times of the camera; defaults if the camera file states none.
  double min_exposure_time_s = kShortestExposure_s, max_exposure_time_s = kLongestExposure_s;
  std::vector<MaterialChoice> materials;
  v1::Lighting lighting;  // radiances and places are checked, spectra by the renderer
  RenderSettings render;
  std::vector<EffectChoice> effects;
  // Unset: the light of the material limits no target.
  std::optional<Detectability> detectability;
  // Ranges that the choice of the optics may vary; set with a lens, every default filled in.
  std::optional<OpticsPlanning> optics;
};

// Reads and validates an inspection file. INVALID_ARGUMENT names file, field path, value and
// allowed range; unknown fields are errors that name the nearest known one. NOT_FOUND: no such
// file.
absl::StatusOr<Inspection> ReadInspection(const std::string& path);

// The same inspection with the contents of camera and material files in the message. All other file
// names are resolved against `base_folder` (names in a material file: against its folder).
absl::StatusOr<v1::Inspection> InlineInspectionFiles(const v1::Inspection& message,
                                                     const std::string& context,
                                                     const std::string& base_folder);

// File names inside a material: tables and height field; without empty names.
std::vector<std::string*> MutableMaterialFiles(v1::Material* material);

// Validates a message; `context` (e.g. the file name) starts every error message. File paths are
// resolved against `base_folder`.
absl::StatusOr<Inspection> ParseInspection(const v1::Inspection& message,
                                           const std::string& context,
                                           const std::string& base_folder);

// Parse the sections of an inspection that the coverage service uses, each by itself, with the same
// rules and messages.
absl::StatusOr<Rig> ParseRig(const v1::Rig& rig, const v1::Camera& camera, const v1::Lens* lens,
                             const v1::Laser& laser, const std::string& context);
absl::StatusOr<TargetSampling> ParseTargetSampling(const v1::TargetSampling& message,
                                                   const std::string& context);
// Parameters that are not given get the bounds of Table 2.1.
absl::StatusOr<MeasurementDomain> ParseMeasurementDomain(const v1::MeasurementDomain& message,
                                                         const std::string& context);
// Checks that the inputs of limits on targets are given (circle of confusion: lens and pixel
// pitch). ParseInspection calls it; callers that parse only rig and targets must call it too.
absl::Status CheckLimitInputs(const Rig& rig, const TargetSampling& sampling,
                              const std::string& context);

// Sets default limits on scans for which the inspection states none. A detail needs two pixels
// across it, so the footprint is at most half the required resolution (by default the coverage
// radius). A line is located to a fraction of a pixel, so one pixel may cover a depth of the
// required resolution. There are no such limits for an uncertainty goal, which includes the effect
// of coarse pixels, and for a required resolution of 0. By the current defaults, incidence to
// camera and laser is at most 70 degrees, and the circle of confusion at most 2 pixels if lens and
// pixel pitch are known.
void DeriveLimits(Inspection* inspection);

// Conversions: degrees in messages, radians inside. They do not check that values are finite.
Measurement MeasurementFromProto(const v1::Measurement& message);
v1::Measurement MeasurementToProto(const Measurement& measurement);

// Back to messages with every default written out, for the wire and for reports.
v1::Camera CameraToProto(const Camera& camera);
v1::Laser LaserToProto(const Laser& laser);
v1::Rig RigToProto(const Rig& rig);
v1::TargetSampling TargetSamplingToProto(const TargetSampling& sampling);
v1::MeasurementDomain MeasurementDomainToProto(const MeasurementDomain& domain);

// nullopt for an unknown or unspecified frame.
std::optional<ObstacleFrame> ObstacleFrameFromProto(v1::Obstacle::Frame frame);
v1::Obstacle::Frame ObstacleFrameToProto(ObstacleFrame frame);
inline constexpr char kObstacleFrameNames[] = "FRAME_PART, FRAME_STAGE, FRAME_TABLE or FRAME_WORLD";

}  // namespace sightline
