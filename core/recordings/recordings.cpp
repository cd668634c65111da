// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/recordings.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <regex>
#include <set>
#include <string_view>
#include <utility>

#include "absl/strings/ascii.h"
#include "core/field_limits/field_checks.h"
#include "core/inspection/imaging.h"
#include "core/inspection/inspection.h"
#include "core/json/json_text.h"
#include "core/json/strict_json.h"
#include "core/recordings/posed_plates.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "core/text/printable.h"

namespace sightline {
namespace {

constexpr char kFormat[] = "laser-line-recordings";
// Stands for null in messages read from and written to JSON, which know no null.
constexpr int kNoPlatePosition = std::numeric_limits<int32_t>::min();

constexpr Limits kFocalLength{1e-4, 1, " m"};
constexpr Limits kFraction{0, 1, ""};
constexpr Limits kPositiveFraction{0, 1, "", true};
constexpr Limits kRoughness{1e-3, 1, ""};
constexpr Limits kWavelength{200e-9, 2000e-9, " m"};
constexpr Limits kPower{0, 100, " W"};
constexpr Limits kDivergence{0, 0.5, " rad", true};
constexpr Limits kBeamFocus{0, 100, " m"};
constexpr Limits kFanAngle{0, 180, " deg", true, true};
constexpr Limits kIncidence{0, 90, " deg", false, true};
constexpr Limits kTimestamp{-1e9, 1e9, " s"};
constexpr Limits kExposure{0, 1000, " s", true};
constexpr Limits kFNumber{0.5, 128, ""};
constexpr Limits kDistance{1e-3, 100, " m"};
constexpr Limits kOffset{-10, 10, " m"};
constexpr Limits kCount{0, 1e9, ""};
constexpr Limits kStage{-100, 100, " m"};

// The fields of a message that must be given, with the path of the message.
class Fields {
 public:
  Fields(const Checker& check, std::string path) : check_(check), path_(std::move(path)) {}

  absl::Status Number(const char* name, bool given, double value, const Limits& limits,
                      double* out) const {
    const std::string field = path_ + name;
    if (!given) return check_.Error(field, "is missing");
    SIGHTLINE_RETURN_IF_ERROR(check_.Range(field, value, limits));
    *out = value;
    return absl::OkStatus();
  }
  absl::Status Integer(const char* name, bool given, int value, const Limits& limits,
                       int* out) const {
    double number = 0;
    SIGHTLINE_RETURN_IF_ERROR(Number(name, given, value, limits, &number));
    *out = value;
    return absl::OkStatus();
  }

 private:
  const Checker& check_;
  std::string path_;
};

absl::Status CheckFile(const Checker& check, const std::string& path, const std::string& file) {
  if (file.empty()) return check.Error(path, "is missing");
  const std::filesystem::path name(file);
  const bool leaves = name.is_absolute() || std::any_of(name.begin(), name.end(),
                                                        [](const auto& p) { return p == ".."; });
  if (leaves) {
    return check.Error(path, absl::StrCat("is \"", file, "\", must stay in the set's folder"));
  }
  if (const std::string shown = Printable(file); shown != file) {
    return check.Error(path, absl::StrCat("is \"", shown, "\", must have no control characters"));
  }
  return absl::OkStatus();
}

// The pose of the plate: laser recordings need one, dark frames have none.
absl::Status ParsePose(const v1::Recording& m, const std::string& path, const Checker& check,
                       RecordedImage* image) {
  if (!m.has_plate_pose()) {
    if (image->kind != RecordingKind::kLaser) return absl::OkStatus();
    return check.Error(path + ".plate_pose", "is missing");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(image->plate_in_camera,
                             ParsePlatePose(m.plate_pose(), path + ".plate_pose", check));
  return absl::OkStatus();
}

absl::StatusOr<RecordedImage> ParseImage(const v1::Recording& m, int version, const Sensor& sensor,
                                         const std::string& path, const Checker& check) {
  const Fields fields(check, path + ".");
  RecordedImage image;
  SIGHTLINE_RETURN_IF_ERROR(CheckFile(check, path + ".file", m.file()));
  image.file = m.file();
  if (m.kind() == "laser") {
    image.kind = RecordingKind::kLaser;
  } else if (m.kind() == "dark") {
    image.kind = RecordingKind::kDark;
  } else if (m.kind() == "ambient") {
    image.kind = RecordingKind::kAmbient;
  } else {
    return check.Error(path + ".kind",
                       m.kind().empty()
                           ? "is missing, must be laser, dark or ambient"
                           : absl::StrCat("is \"", m.kind(), "\", must be laser, dark or ambient"));
  }
  image.series = m.series();
  image.same_speckle = m.same_speckle();
  SIGHTLINE_RETURN_IF_ERROR(fields.Number("exposure_time_s", m.has_exposure_time_s(),
                                          m.exposure_time_s(), kExposure, &image.exposure_time_s));
  SIGHTLINE_RETURN_IF_ERROR(
      fields.Number("f_number", m.has_f_number(), m.f_number(), kFNumber, &image.f_number));
  const Limits column{-0.5 * sensor.columns_px - 1, 0.5 * sensor.columns_px, " px"};
  const Limits row{-0.5 * sensor.rows_px - 1, 0.5 * sensor.rows_px, " px"};
  SIGHTLINE_RETURN_IF_ERROR(fields.Integer("roi_column_px", m.has_roi_column_px(),
                                           m.roi_column_px(), column, &image.roi_column_px));
  SIGHTLINE_RETURN_IF_ERROR(
      fields.Integer("roi_row_px", m.has_roi_row_px(), m.roi_row_px(), row, &image.roi_row_px));
  SIGHTLINE_RETURN_IF_ERROR(
      fields.Integer("roi_columns_px", m.has_roi_columns_px(), m.roi_columns_px(),
                     {1, static_cast<double>(sensor.columns_px), " px"}, &image.roi_columns_px));
  SIGHTLINE_RETURN_IF_ERROR(fields.Integer("roi_rows_px", m.has_roi_rows_px(), m.roi_rows_px(),
                                           {1, static_cast<double>(sensor.rows_px), " px"},
                                           &image.roi_rows_px));
  // Principal point: the centre of pixel (rows/2, columns/2).
  const int first_column = sensor.columns_px / 2 + image.roi_column_px;
  const int first_row = sensor.rows_px / 2 + image.roi_row_px;
  if (first_column < 0 || first_column + image.roi_columns_px > sensor.columns_px ||
      first_row < 0 || first_row + image.roi_rows_px > sensor.rows_px) {
    return check.Error(path + ".roi_column_px",
                       absl::StrCat("and the other three give the sensor's columns ", first_column,
                                    " to ", first_column + image.roi_columns_px - 1, " and rows ",
                                    first_row, " to ", first_row + image.roi_rows_px - 1,
                                    "; it has ", sensor.columns_px, " x ", sensor.rows_px, " px"));
  }
  if (version == 2) {
    if (m.has_timestamp_s()) {
      SIGHTLINE_RETURN_IF_ERROR(
          fields.Number("timestamp_s", true, m.timestamp_s(), kTimestamp, &image.timestamp_s));
    }
    if (!m.has_measurement()) return check.Error(path + ".measurement", "is missing");
    image.measurement = MeasurementFromProto(m.measurement());
    SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".measurement.camera_distance_m",
                                          image.measurement.camera_distance_m, kDistance));
    SIGHTLINE_RETURN_IF_ERROR(fields.Integer("scan", m.has_scan(), m.scan(), kCount, &image.scan));
    image.frame = m.frame();
    SIGHTLINE_RETURN_IF_ERROR(fields.Number("stage_position_m", m.has_stage_position_m(),
                                            m.stage_position_m(), kStage, &image.stage_position_m));
    image.camera_distance_m = m.camera_distance_m();
    image.focus_distance_m = m.focus_distance_m();
    image.laser_distance_m = m.laser_distance_m();
    return image;
  }
  SIGHTLINE_RETURN_IF_ERROR(fields.Number("timestamp_s", m.has_timestamp_s(), m.timestamp_s(),
                                          kTimestamp, &image.timestamp_s));
  if (version == 3) SIGHTLINE_RETURN_IF_ERROR(ParsePose(m, path, check, &image));
  if (m.has_plate_position_id() && m.plate_position_id() != kNoPlatePosition) {
    image.plate_position_id = m.plate_position_id();
  } else if (image.kind != RecordingKind::kDark) {
    return check.Error(path + ".plate_position_id", "is missing; only dark frames have none");
  }
  SIGHTLINE_RETURN_IF_ERROR(fields.Integer("burst_frame_index", m.has_burst_frame_index(),
                                           m.burst_frame_index(), kCount,
                                           &image.burst_frame_index));
  if (!m.has_same_speckle()) return check.Error(path + ".same_speckle", "is missing");
  if (version == 3) {
    if (image.burst_frame_index > 0) {
      return check.Error(
          path + ".burst_frame_index",
          absl::StrCat("is ", image.burst_frame_index, ", must be 0 in format_version 3"));
    }
    SIGHTLINE_RETURN_IF_ERROR(fields.Number("focus_distance_m", m.has_focus_distance_m(),
                                            m.focus_distance_m(), kDistance,
                                            &image.focus_distance_m));
    SIGHTLINE_RETURN_IF_ERROR(fields.Integer("repeat_group", m.has_repeat_group(), m.repeat_group(),
                                             kCount, &image.repeat_group));
    return image;
  }
  SIGHTLINE_RETURN_IF_ERROR(fields.Number("camera_distance_m", m.has_camera_distance_m(),
                                          m.camera_distance_m(), kDistance,
                                          &image.camera_distance_m));
  SIGHTLINE_RETURN_IF_ERROR(fields.Number("focus_distance_m", m.has_focus_distance_m(),
                                          m.focus_distance_m(), kDistance,
                                          &image.focus_distance_m));
  SIGHTLINE_RETURN_IF_ERROR(fields.Number("laser_distance_m", m.has_laser_distance_m(),
                                          m.laser_distance_m(), kDistance,
                                          &image.laser_distance_m));
  SIGHTLINE_RETURN_IF_ERROR(fields.Number("line_offset_m", m.has_line_offset_m(), m.line_offset_m(),
                                          kOffset, &image.line_offset_m));
  SIGHTLINE_RETURN_IF_ERROR(fields.Integer("repeat_group", m.has_repeat_group(), m.repeat_group(),
                                           kCount, &image.repeat_group));
  return image;
}

}  // namespace

absl::StatusOr<SetupDeviation> ParseSetupDeviation(const v1::Recordings::Uncertainty& message,
                                                   bool may_be_negative, const std::string& path,
                                                   const std::string& context) {
  const Checker check(context);
  const auto* descriptor = v1::Recordings::Uncertainty::descriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const auto* field = descriptor->field(i);
    const double value = message.GetReflection()->GetDouble(message, field);
    // A relative deviation below -1 would turn a sign; larger ones than this are no deviations.
    const Limits limits{may_be_negative ? -0.999 : 0, 1000, ""};
    SIGHTLINE_RETURN_IF_ERROR(check.Range(absl::StrCat(path, ".", field->name()), value, limits));
  }
  SetupDeviation d;
  d.camera_distance_m = message.camera_distance_m();
  d.focus_distance_relative = message.focus_distance_relative();
  d.f_number_relative = message.f_number_relative();
  d.laser_distance_m = message.laser_distance_m();
  d.beam_focus_distance_m = message.beam_focus_distance_m();
  d.incidence_angle_rad = Radians(message.incidence_angle_deg());
  d.divergence_relative = message.divergence_relative();
  d.power_relative = message.power_relative();
  d.transmission_relative = message.transmission_relative();
  d.diffuse_albedo_relative = message.diffuse_albedo_relative();
  d.specular_f0_relative = message.specular_f0_relative();
  d.ggx_alpha_relative = message.ggx_alpha_relative();
  d.quantum_efficiency_relative = message.quantum_efficiency_relative();
  d.gain_relative = message.gain_relative();
  d.dark_mean_electrons = message.dark_mean_electrons();
  d.dark_noise_relative = message.dark_noise_relative();
  d.line_position_common_px = message.line_position_common_px();
  d.line_position_each_px = message.line_position_each_px();
  return d;
}

absl::StatusOr<RecordingSet> ParseRecordings(const v1::Recordings& message,
                                             const std::string& context) {
  const Checker check(context);
  if (message.format() != kFormat) {
    return check.Error("format", absl::StrCat(message.format().empty()
                                                  ? std::string("is missing")
                                                  : absl::StrCat("is \"", message.format(), "\""),
                                              ", must be \"", kFormat, "\""));
  }
  RecordingSet set;
  set.format_version = message.format_version();
  if (set.format_version < 1 || set.format_version > 3) {
    return check.Error("format_version",
                       absl::StrCat("is ", set.format_version,
                                    ", must be 1 (a plate), 2 (a part) or 3 (plates in poses)"));
  }
  set.name = message.set();
  if (!message.has_camera()) return check.Error("camera", "is missing");
  SIGHTLINE_ASSIGN_OR_RETURN(
      set.camera, ParseSensor(message.camera(), context.empty() ? "camera" : context + ": camera"));

  const Fields lens(check, "lens.");
  SIGHTLINE_RETURN_IF_ERROR(lens.Number("focal_length_m", message.lens().has_focal_length_m(),
                                        message.lens().focal_length_m(), kFocalLength,
                                        &set.focal_length_m));
  SIGHTLINE_RETURN_IF_ERROR(lens.Number("transmission", message.lens().has_transmission(),
                                        message.lens().transmission(), kPositiveFraction,
                                        &set.transmission));
  const Fields laser(check, "laser.");
  const v1::Recordings::RecordedLaser& l = message.laser();
  SIGHTLINE_RETURN_IF_ERROR(laser.Number("wavelength_m", l.has_wavelength_m(), l.wavelength_m(),
                                         kWavelength, &set.laser.wavelength_m));
  SIGHTLINE_RETURN_IF_ERROR(
      laser.Number("power_w", l.has_power_w(), l.power_w(), kPower, &set.laser.power_w));
  SIGHTLINE_RETURN_IF_ERROR(laser.Number("divergence_rad", l.has_divergence_rad(),
                                         l.divergence_rad(), kDivergence,
                                         &set.laser.divergence_rad));
  SIGHTLINE_RETURN_IF_ERROR(laser.Number("beam_focus_distance_m", l.has_beam_focus_distance_m(),
                                         l.beam_focus_distance_m(), kBeamFocus,
                                         &set.laser.beam_focus_distance_m));
  double fan_angle_deg = 0;
  SIGHTLINE_RETURN_IF_ERROR(laser.Number("fan_angle_deg", l.has_fan_angle_deg(), l.fan_angle_deg(),
                                         kFanAngle, &fan_angle_deg));
  set.laser.fan_angle_rad = Radians(fan_angle_deg);

  if (set.format_version != 3) {
    if (message.has_pixel_camera()) {
      return check.Error("pixel_camera", "belongs to format_version 3");
    }
    if (message.has_laser_plane()) return check.Error("laser_plane", "belongs to format_version 3");
    for (int i = 0; i < message.recordings_size(); ++i) {
      if (!message.recordings(i).has_plate_pose()) continue;
      return check.Error(absl::StrCat("recordings[", i, "].plate_pose"),
                         "belongs to format_version 3");
    }
  }
  if (set.format_version != 2) {
    if (message.has_part()) return check.Error("part", "belongs to format_version 2");
    const Fields surface(check, "surface.");
    const v1::Recordings::PlateSurface& s = message.surface();
    SIGHTLINE_RETURN_IF_ERROR(surface.Number("diffuse_albedo", s.has_diffuse_albedo(),
                                             s.diffuse_albedo(), kFraction,
                                             &set.surface.diffuse_albedo));
    SIGHTLINE_RETURN_IF_ERROR(surface.Number("specular_f0", s.has_specular_f0(), s.specular_f0(),
                                             kFraction, &set.surface.specular_f0));
    SIGHTLINE_RETURN_IF_ERROR(surface.Number("ggx_alpha", s.has_ggx_alpha(), s.ggx_alpha(),
                                             kRoughness, &set.surface.ggx_alpha));
  }
  if (set.format_version == 1) {
    double incidence_deg = 0;
    SIGHTLINE_RETURN_IF_ERROR(
        Fields(check, "rig.")
            .Number("incidence_angle_deg", message.rig().has_incidence_angle_deg(),
                    message.rig().incidence_angle_deg(), kIncidence, &incidence_deg));
    set.incidence_angle_rad = Radians(incidence_deg);
  } else if (set.format_version == 3) {
    if (message.has_rig()) {
      return check.Error("rig", "belongs to format_version 1: angles follow from the poses");
    }
    SIGHTLINE_ASSIGN_OR_RETURN(set.posed, ParsePosedPlates(message, set.camera, check));
  } else {
    if (message.has_surface()) return check.Error("surface", "belongs to format_version 1");
    if (message.has_rig()) return check.Error("rig", "belongs to format_version 1");
    if (!message.has_part()) return check.Error("part", "is missing");
    RecordedPart part;
    part.file = message.part().file();
    part.part_digest = message.part().part_digest();
    if (part.file.empty()) return check.Error("part.file", "is missing");
    const std::string part_context = context.empty() ? "part" : context + ": part";
    SIGHTLINE_ASSIGN_OR_RETURN(part.lens, ParseLens(message.part().lens(), part_context));
    SIGHTLINE_ASSIGN_OR_RETURN(part.laser, ParseLaser(message.part().laser(), part_context));
    part.materials = {message.part().materials().begin(), message.part().materials().end()};
    part.lighting = message.part().lighting();
    set.part = std::move(part);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      set.uncertainty, ParseSetupDeviation(message.uncertainty(), false, "uncertainty", context));

  if (message.recordings().empty()) return check.Error("recordings", "is empty");
  std::set<std::string> files;
  for (int i = 0; i < message.recordings_size(); ++i) {
    const std::string path = absl::StrCat("recordings[", i, "]");
    SIGHTLINE_ASSIGN_OR_RETURN(
        RecordedImage image,
        ParseImage(message.recordings(i), set.format_version, set.camera, path, check));
    if (!files.insert(image.file).second) {
      return check.Error(path + ".file",
                         absl::StrCat("is \"", image.file, "\" like that of another recording"));
    }
    if (image.focus_distance_m <= set.focal_length_m && set.format_version != 2) {
      return check.Error(
          path + ".focus_distance_m",
          absl::StrCat("is ", NumberText(image.focus_distance_m),
                       ", must be above lens.focal_length_m = ", NumberText(set.focal_length_m)));
    }
    if (!set.recordings.empty() && image.timestamp_s < set.recordings.back().timestamp_s) {
      return check.Error(path + ".timestamp_s",
                         absl::StrCat("is ", NumberText(image.timestamp_s),
                                      ", before that of the recording before: recordings are in "
                                      "order of time"));
    }
    if (image.burst_frame_index > 0 &&
        (set.recordings.empty() ||
         set.recordings.back().burst_frame_index + 1 != image.burst_frame_index)) {
      return check.Error(
          path + ".burst_frame_index",
          absl::StrCat("is ", image.burst_frame_index, ", must follow the recording with ",
                       image.burst_frame_index - 1));
    }
    if (image.burst_frame_index > 0 &&
        (image.roi_columns_px != set.recordings.back().roi_columns_px ||
         image.roi_rows_px != set.recordings.back().roi_rows_px)) {
      return check.Error(path + ".roi_columns_px",
                         "differs from that of the frame before in the same burst");
    }
    if (set.posed && image.kind == RecordingKind::kLaser) {
      SIGHTLINE_RETURN_IF_ERROR(CheckLineInRegion(*set.posed, set.camera, image, path, check));
    }
    set.recordings.push_back(std::move(image));
  }
  return set;
}

std::string NumberNullPlatePositions(std::string json) {
  constexpr std::string_view kMember = "\"plate_position_id\"";
  constexpr std::string_view kNull = "null";
  std::string result;
  size_t copied = 0;
  const auto skip_space = [&](size_t at) {
    while (at < json.size() && absl::ascii_isspace(static_cast<unsigned char>(json[at]))) ++at;
    return at;
  };
  // A quote inside a JSON string is preceded by a backslash, so this finds members only.
  for (size_t at = json.find(kMember); at != std::string::npos; at = json.find(kMember, at + 1)) {
    const size_t colon = skip_space(at + kMember.size());
    if (colon >= json.size() || json[colon] != ':') continue;
    const size_t value = skip_space(colon + 1);
    if (json.compare(value, kNull.size(), kNull) != 0) continue;
    result.append(json, copied, value - copied);
    absl::StrAppend(&result, kNoPlatePosition);
    copied = value + kNull.size();
  }
  if (copied == 0) return json;
  return result.append(json, copied);
}

absl::Status ReadRecordingsMessage(const std::string& path, v1::Recordings* message) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string text, ReadJsonText(path));
  return ParseStrictJson(NumberNullPlatePositions(std::move(text)), path, message);
}

absl::StatusOr<RecordingSet> ReadRecordings(const std::string& path) {
  v1::Recordings message;
  SIGHTLINE_RETURN_IF_ERROR(ReadRecordingsMessage(path, &message));
  return ParseRecordings(message, path);
}

namespace {

void SetVector(const Eigen::Vector3d& from, v1::Vector3* to) {
  to->set_x(from.x());
  to->set_y(from.y());
  to->set_z(from.z());
}

// The fields of version 3 of a set, reduced or not.
void SetPosedPlates(const RecordingSet& set, v1::Recordings* message) {
  if (set.posed->transposed) {
    message->mutable_camera()->set_sensor_columns_px(set.camera.rows_px);
    message->mutable_camera()->set_sensor_rows_px(set.camera.columns_px);
  }
  const TargetCamera& camera = set.posed->camera;
  v1::Recordings::PixelCamera* pixel = message->mutable_pixel_camera();
  pixel->set_focal_length_px(camera.fx);
  pixel->set_principal_point_column_px(camera.cx);
  pixel->set_principal_point_row_px(camera.cy);
  v1::Lens::Distortion* distortion = pixel->mutable_distortion();
  distortion->set_k1(camera.distortion[0]);
  distortion->set_k2(camera.distortion[1]);
  distortion->set_p1(camera.distortion[2]);
  distortion->set_p2(camera.distortion[3]);
  distortion->set_k3(camera.distortion[4]);
  v1::Recordings::LaserPlane* plane = message->mutable_laser_plane();
  SetVector(set.posed->sheet.normal, plane->mutable_normal());
  plane->set_offset_m(set.posed->sheet.offset_m);
  if (set.posed->sheet.origin_m) {
    SetVector(*set.posed->sheet.origin_m, plane->mutable_origin_m());
  }
}

void SetPosedImage(const RecordedImage& image, v1::Recording* m) {
  if (image.plate_position_id) m->set_plate_position_id(*image.plate_position_id);
  m->set_same_speckle(image.same_speckle);
  m->set_burst_frame_index(image.burst_frame_index);
  m->set_repeat_group(image.repeat_group);
  const ImagePart part = image.part_of_image.value_or(ImagePart{
      image.file, image.roi_column_px, image.roi_row_px, image.roi_columns_px, image.roi_rows_px});
  m->set_file(part.file);
  m->set_roi_column_px(part.column_px);
  m->set_roi_row_px(part.row_px);
  m->set_roi_columns_px(part.columns_px);
  m->set_roi_rows_px(part.rows_px);
  if (!image.plate_in_camera) return;
  v1::Recording::PlatePose* pose = m->mutable_plate_pose();
  for (int i = 0; i < 9; ++i) pose->add_rotation(image.plate_in_camera->linear()(i / 3, i % 3));
  SetVector(image.plate_in_camera->translation(), pose->mutable_translation_m());
}

}  // namespace

v1::Recordings RecordingsToProto(const RecordingSet& set) {
  v1::Recordings message;
  message.set_format(kFormat);
  message.set_format_version(set.posed ? 3 : set.format_version);
  message.set_set(set.name);
  *message.mutable_camera() = SensorToProto(set.camera);
  if (set.posed) SetPosedPlates(set, &message);
  if (set.format_version != 2) {
    v1::Sensor* camera = message.mutable_camera();
    const Sensor null;
    if (set.camera.dark_current_electrons_per_s == 0) {
      camera->clear_dark_current_doubling_k();
      camera->clear_dark_current_reference_temperature_c();
    }
    if (set.camera.prnu_relative == null.prnu_relative) camera->clear_prnu_relative();
    if (set.camera.dsnu_electrons == null.dsnu_electrons) camera->clear_dsnu_electrons();
    if (set.camera.black_level_dn == null.black_level_dn) camera->clear_black_level_dn();
  }
  message.mutable_lens()->set_focal_length_m(set.focal_length_m);
  message.mutable_lens()->set_transmission(set.transmission);
  v1::Recordings::RecordedLaser* laser = message.mutable_laser();
  laser->set_wavelength_m(set.laser.wavelength_m);
  laser->set_power_w(set.laser.power_w);
  laser->set_divergence_rad(set.laser.divergence_rad);
  laser->set_beam_focus_distance_m(set.laser.beam_focus_distance_m);
  laser->set_fan_angle_deg(Degrees(set.laser.fan_angle_rad));
  if (set.format_version != 2) {
    v1::Recordings::PlateSurface* surface = message.mutable_surface();
    surface->set_diffuse_albedo(set.surface.diffuse_albedo);
    surface->set_specular_f0(set.surface.specular_f0);
    surface->set_ggx_alpha(set.surface.ggx_alpha);
  }
  if (set.format_version == 1 && !set.posed) {
    message.mutable_rig()->set_incidence_angle_deg(Degrees(set.incidence_angle_rad));
  }
  v1::Recordings::Uncertainty* u = message.mutable_uncertainty();
  u->set_camera_distance_m(set.uncertainty.camera_distance_m);
  u->set_focus_distance_relative(set.uncertainty.focus_distance_relative);
  u->set_f_number_relative(set.uncertainty.f_number_relative);
  u->set_laser_distance_m(set.uncertainty.laser_distance_m);
  u->set_beam_focus_distance_m(set.uncertainty.beam_focus_distance_m);
  u->set_incidence_angle_deg(Degrees(set.uncertainty.incidence_angle_rad));
  u->set_divergence_relative(set.uncertainty.divergence_relative);
  u->set_power_relative(set.uncertainty.power_relative);
  u->set_transmission_relative(set.uncertainty.transmission_relative);
  u->set_diffuse_albedo_relative(set.uncertainty.diffuse_albedo_relative);
  u->set_specular_f0_relative(set.uncertainty.specular_f0_relative);
  u->set_ggx_alpha_relative(set.uncertainty.ggx_alpha_relative);
  u->set_quantum_efficiency_relative(set.uncertainty.quantum_efficiency_relative);
  u->set_gain_relative(set.uncertainty.gain_relative);
  u->set_dark_mean_electrons(set.uncertainty.dark_mean_electrons);
  u->set_dark_noise_relative(set.uncertainty.dark_noise_relative);
  u->set_line_position_common_px(set.uncertainty.line_position_common_px);
  u->set_line_position_each_px(set.uncertainty.line_position_each_px);
  for (const RecordedImage& image : set.recordings) {
    v1::Recording* m = message.add_recordings();
    m->set_file(image.file);
    m->set_kind(image.kind == RecordingKind::kLaser  ? "laser"
                : image.kind == RecordingKind::kDark ? "dark"
                                                     : "ambient");
    m->set_timestamp_s(image.timestamp_s);
    m->set_series(image.series);
    m->set_exposure_time_s(image.exposure_time_s);
    m->set_f_number(image.f_number);
    m->set_focus_distance_m(image.focus_distance_m);
    if (set.posed) {
      SetPosedImage(image, m);
      continue;
    }
    m->set_camera_distance_m(image.camera_distance_m);
    m->set_laser_distance_m(image.laser_distance_m);
    m->set_roi_column_px(image.roi_column_px);
    m->set_roi_row_px(image.roi_row_px);
    m->set_roi_columns_px(image.roi_columns_px);
    m->set_roi_rows_px(image.roi_rows_px);
    if (set.format_version == 1) {
      m->set_plate_position_id(image.plate_position_id.value_or(kNoPlatePosition));
      m->set_same_speckle(image.same_speckle);
      m->set_burst_frame_index(image.burst_frame_index);
      m->set_line_offset_m(image.line_offset_m);
      m->set_repeat_group(image.repeat_group);
    } else {
      *m->mutable_measurement() = MeasurementToProto(image.measurement);
      m->set_scan(image.scan);
      m->set_frame(image.frame);
      m->set_stage_position_m(image.stage_position_m);
    }
  }
  if (set.part) {
    v1::Recordings::RecordedPart* part = message.mutable_part();
    part->set_file(set.part->file);
    part->set_part_digest(set.part->part_digest);
    *part->mutable_lens() = LensToProto(set.part->lens);
    *part->mutable_laser() = ImagingLaserToProto(set.part->laser);
    for (const v1::MaterialAssignment& material : set.part->materials) {
      *part->add_materials() = material;
    }
    *part->mutable_lighting() = set.part->lighting;
  }
  return message;
}

std::string RecordingsToJson(const v1::Recordings& message) {
  v1::Recordings complete = message;
  if (complete.format_version() == 1) {
    for (v1::Recording& recording : *complete.mutable_recordings()) {
      if (!recording.has_plate_position_id()) recording.set_plate_position_id(kNoPlatePosition);
    }
  }
  static const std::regex sentinel(
      absl::StrCat("\"plate_position_id\": ", kNoPlatePosition, "\\b"));
  return std::regex_replace(ToJson(complete), sentinel, "\"plate_position_id\": null");
}

}  // namespace sightline
