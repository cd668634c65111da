// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/imaging.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "core/field_limits/field_checks.h"
#include "core/field_limits/imaging_limits.h"
#include "core/inspection/vector_proto.h"
#include "core/json/error_list.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr Limits kZernike{-1e-4, 1e-4, " m"};
constexpr Limits kSensorTilt{-30, 30, " deg"};
constexpr int kMaxZernikeTerms = 66;

constexpr Limits kLaserDistance{0.02, 5, " m"};
constexpr Limits kFanAngle{0, 180, " deg", true, true};
constexpr Limits kLaserPower{0, 100, " W"};
constexpr Limits kDivergence{0, 0.5, " rad", true};
constexpr Limits kBeamFocus{0, 100, " m"};
constexpr Limits kBeamQuality{1, 1000, ""};

constexpr Limits kRadiance{0, 1e6, " W/(m^2 sr)"};
constexpr Limits kLightPosition{-1000, 1000, " m"};
constexpr Limits kSubPixels{2, 64, ""};
constexpr Limits kNoiseTarget{1e-4, 1, ""};
constexpr Limits kSamples{1, 1 << 20, ""};
constexpr Limits kBounces{0, 32, ""};
constexpr Limits kStageSpeed{0, 10, " m/s"};
constexpr Limits kSensorTemperature{-60, 120, " C"};
constexpr Limits kSpecklePatterns{1, 1000, ""};
// How far a stated field of view may be from that of rows, pixel pitch and focal length. Data
// sheets round, and a lens that focuses near forms its image farther away than at infinity: by 8.7
// % with 16 mm at 0.2 m.
constexpr double kFieldOfViewAgreement = 0.1;

// Relative to `base_folder`; an empty name stays empty.
std::string Resolve(const std::string& base_folder, const std::string& file) {
  if (file.empty()) return file;
  const std::filesystem::path path(file);
  if (path.is_absolute()) return path.lexically_normal().string();
  return (std::filesystem::path(base_folder) / path).lexically_normal().string();
}

void ResolveMaterialFiles(const std::string& base_folder, v1::Material* material) {
  for (std::string* file : MutableMaterialFiles(material)) *file = Resolve(base_folder, *file);
}

absl::Status CheckPlace(const Checker& check, const std::string& path, bool given,
                        const v1::Vector3& v) {
  if (!given) return check.Error(path, "is missing");
  SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".x", v.x(), kLightPosition));
  SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".y", v.y(), kLightPosition));
  return check.Range(path + ".z", v.z(), kLightPosition);
}

absl::Status CheckLighting(const v1::Lighting& lighting, const Checker& check) {
  if (lighting.has_ambient()) {
    const std::string path = "lighting.ambient.radiance_w_m2_sr";
    if (!lighting.ambient().has_radiance_w_m2_sr()) return check.Error(path, "is missing");
    SIGHTLINE_RETURN_IF_ERROR(check.Range(path, lighting.ambient().radiance_w_m2_sr(), kRadiance));
  }
  for (int i = 0; i < lighting.area_lights_size(); ++i) {
    const v1::AreaLight& light = lighting.area_lights(i);
    const std::string path = absl::StrCat("lighting.area_lights[", i, "]");
    if (!light.has_radiance_w_m2_sr()) return check.Error(path + ".radiance_w_m2_sr", "is missing");
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(path + ".radiance_w_m2_sr", light.radiance_w_m2_sr(), kRadiance));
    SIGHTLINE_RETURN_IF_ERROR(
        CheckPlace(check, path + ".centre_m", light.has_centre_m(), light.centre_m()));
    SIGHTLINE_RETURN_IF_ERROR(CheckPlace(check, path + ".half_edge_u_m", light.has_half_edge_u_m(),
                                         light.half_edge_u_m()));
    SIGHTLINE_RETURN_IF_ERROR(CheckPlace(check, path + ".half_edge_v_m", light.has_half_edge_v_m(),
                                         light.half_edge_v_m()));
    const Eigen::Vector3d u = VectorFromProto(light.half_edge_u_m()),
                          v = VectorFromProto(light.half_edge_v_m());
    if (u.norm() == 0 || v.norm() == 0) {
      return check.Error(path, "has a half edge of length 0");
    }
    if (std::abs(u.dot(v)) > 1e-6 * u.norm() * v.norm()) {
      return check.Error(path + ".half_edge_v_m", "is not perpendicular to half_edge_u_m");
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<RenderSettings> ParseRenderSettings(const v1::RenderSettings& message,
                                                   const Checker& check) {
  RenderSettings settings;
  if (message.has_exposure_time_s()) settings.exposure_time_s = message.exposure_time_s();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("render.exposure_time_s", settings.exposure_time_s, kExposureTime));
  if (message.has_seed()) settings.seed = message.seed();
  if (message.has_sub_pixels()) {
    settings.sub_pixels = message.sub_pixels();
    SIGHTLINE_RETURN_IF_ERROR(check.Range("render.sub_pixels", settings.sub_pixels, kSubPixels));
  }
  if (message.has_noise_target_relative()) {
    settings.noise_target_relative = message.noise_target_relative();
  }
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("render.noise_target_relative", settings.noise_target_relative, kNoiseTarget));
  if (message.has_max_samples_per_px()) settings.max_samples_per_px = message.max_samples_per_px();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("render.max_samples_per_px", settings.max_samples_per_px, kSamples));
  if (message.has_max_bounces()) settings.max_bounces = message.max_bounces();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("render.max_bounces", settings.max_bounces, kBounces));
  if (message.has_laser_interreflection()) {
    settings.laser_interreflection = message.laser_interreflection();
  }
  if (message.has_stage_speed_m_per_s()) {
    settings.stage_speed_m_per_s = message.stage_speed_m_per_s();
  }
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("render.stage_speed_m_per_s", settings.stage_speed_m_per_s, kStageSpeed));
  if (message.has_sensor_temperature_c()) {
    settings.sensor_temperature_c = message.sensor_temperature_c();
    SIGHTLINE_RETURN_IF_ERROR(check.Range("render.sensor_temperature_c",
                                          *settings.sensor_temperature_c, kSensorTemperature));
  }
  if (message.has_speckle_patterns()) settings.speckle_patterns = message.speckle_patterns();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("render.speckle_patterns", settings.speckle_patterns, kSpecklePatterns));
  if (message.has_speckle()) settings.speckle = message.speckle();
  return settings;
}

}  // namespace

std::vector<std::string*> MutableMaterialFiles(v1::Material* material) {
  std::vector<std::string*> files;
  if (material->has_conductor() && !material->conductor().refractive_index_file().empty()) {
    files.push_back(material->mutable_conductor()->mutable_refractive_index_file());
  }
  if (material->has_measured_table() && !material->measured_table().file().empty()) {
    files.push_back(material->mutable_measured_table()->mutable_file());
  }
  if (material->has_merl() && !material->merl().file().empty()) {
    files.push_back(material->mutable_merl()->mutable_file());
  }
  if (material->has_height_field() && !material->height_field().file().empty()) {
    files.push_back(material->mutable_height_field()->mutable_file());
  }
  return files;
}

namespace {

// A material file's contents in place of its name. A file that cannot be read is left out.
absl::Status InlineMaterial(const Checker& check, const std::string& path,
                            const std::string& base_folder, v1::MaterialAssignment* assignment) {
  if (assignment->file().empty()) {
    if (!assignment->has_material()) return check.Error(path, "has neither file nor material");
    ResolveMaterialFiles(base_folder, assignment->mutable_material());
    return absl::OkStatus();
  }
  if (assignment->has_material()) {
    return check.Error(path + ".material",
                       absl::StrCat("cannot be given together with ", path, ".file"));
  }
  const std::string file = Resolve(base_folder, assignment->file());
  assignment->clear_file();
  v1::Material* material = assignment->mutable_material();
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(file, material));
  ResolveMaterialFiles(std::filesystem::path(file).parent_path().string(), material);
  if (material->name().empty()) {
    material->set_name(std::filesystem::path(file).filename().string());
  }
  return absl::OkStatus();
}

absl::Status InlineSensor(const Checker& check, const std::string& base_folder,
                          v1::Camera* camera) {
  if (camera->sensor_file().empty()) return absl::OkStatus();
  const std::string file = Resolve(base_folder, camera->sensor_file());
  camera->clear_sensor_file();
  if (camera->has_sensor()) {
    return check.Error("camera.sensor", "cannot be given together with camera.sensor_file");
  }
  v1::Sensor sensor;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(file, &sensor));
  // Here the message names the camera file.
  SIGHTLINE_RETURN_IF_ERROR(ParseSensor(sensor, file).status());
  *camera->mutable_sensor() = std::move(sensor);
  return absl::OkStatus();
}

}  // namespace

absl::Status InlineFiles(const v1::Inspection& message, const std::string& context,
                         const std::string& base_folder, v1::Inspection* result) {
  const Checker check(context);
  ErrorList errors;
  *result = message;
  errors.Add(InlineSensor(check, base_folder, result->mutable_camera()));
  if (!message.has_camera()) result->clear_camera();
  result->mutable_part()->set_file(Resolve(base_folder, message.part().file()));
  if (message.has_tolerances()) {
    result->mutable_tolerances()->set_file(Resolve(base_folder, message.tolerances().file()));
  }
  for (v1::Obstacle& obstacle : *result->mutable_obstacles()) {
    obstacle.set_file(Resolve(base_folder, obstacle.file()));
  }
  if (result->rig().has_robot()) {
    v1::Robot* robot = result->mutable_rig()->mutable_robot();
    robot->set_urdf(Resolve(base_folder, robot->urdf()));
  }
  for (int i = 0; i < result->materials_size() && !errors.full(); ++i) {
    errors.Add(InlineMaterial(check, absl::StrCat("materials[", i, "]"), base_folder,
                              result->mutable_materials(i)));
  }
  return errors.Status();
}

absl::StatusOr<v1::Inspection> InlineInspectionFiles(const v1::Inspection& message,
                                                     const std::string& context,
                                                     const std::string& base_folder) {
  v1::Inspection result;
  SIGHTLINE_RETURN_IF_ERROR(InlineFiles(message, context, base_folder, &result));
  return result;
}

namespace {

// Reads the lens's adjustable range and checks that its settings lie in it.
absl::StatusOr<Lens> ParseLensRange(const v1::Lens& message, const Checker& check, Lens lens) {
  if (message.has_min_f_number()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("lens.min_f_number", message.min_f_number(), kLensFNumber));
    lens.min_f_number = message.min_f_number();
  }
  if (message.has_max_f_number()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("lens.max_f_number", message.max_f_number(),
                    {lens.min_f_number.value_or(kLensFNumber.min), kLensFNumber.max, ""}));
    lens.max_f_number = message.max_f_number();
  }
  SIGHTLINE_RETURN_IF_ERROR(check.Range("lens.f_number", lens.f_number,
                                        {lens.min_f_number.value_or(kLensFNumber.min),
                                         lens.max_f_number.value_or(kLensFNumber.max), ""}));
  if (message.has_min_focus_distance_m()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("lens.min_focus_distance_m",
                                          message.min_focus_distance_m(),
                                          {1.01 * lens.focal_length_m, 1000, " m"}));
    lens.min_focus_distance_m = message.min_focus_distance_m();
    if (lens.focus_distance_m) {
      SIGHTLINE_RETURN_IF_ERROR(check.Range("lens.focus_distance_m", *lens.focus_distance_m,
                                            {*lens.min_focus_distance_m, 1000, " m"}));
    }
  }
  return lens;
}

}  // namespace

absl::StatusOr<Lens> ParseLens(const v1::Lens& message, const std::string& context) {
  const Checker check(context);
  ErrorList missing;
  if (!message.has_focal_length_m()) {
    missing.Add(check.Error("lens.focal_length_m", "is missing"));
  }
  if (!message.has_f_number()) missing.Add(check.Error("lens.f_number", "is missing"));
  if (!missing.empty()) return missing.Status();
  Lens lens;
  lens.focal_length_m = message.focal_length_m();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("lens.focal_length_m", lens.focal_length_m, kLensFocalLength));
  lens.f_number = message.f_number();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("lens.f_number", lens.f_number, kLensFNumber));
  if (message.has_focus_distance_m()) {
    lens.focus_distance_m = message.focus_distance_m();
    // Nearer there is no real image.
    SIGHTLINE_RETURN_IF_ERROR(check.Range("lens.focus_distance_m", *lens.focus_distance_m,
                                          {1.01 * lens.focal_length_m, 1000, " m"}));
  }
  if (message.has_transmission()) lens.transmission = message.transmission();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("lens.transmission", lens.transmission, kLensTransmission));
  lens.aperture_blades = message.aperture_blades();
  if (lens.aperture_blades != 0) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("lens.aperture_blades", lens.aperture_blades, kApertureBlades));
  }
  SIGHTLINE_RETURN_IF_ERROR(check.Range("lens.aperture_rotation_deg",
                                        message.aperture_rotation_deg(), {-360, 360, " deg"}));
  lens.aperture_rotation_rad = Radians(message.aperture_rotation_deg());
  lens.obstruction_relative = message.obstruction_relative();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("lens.obstruction_relative", lens.obstruction_relative, {0, 1, "", false, true}));
  if (message.zernike_m_size() > kMaxZernikeTerms) {
    return check.Error("lens.zernike_m", absl::StrCat("has ", message.zernike_m_size(),
                                                      " terms, at most ", kMaxZernikeTerms));
  }
  for (int i = 0; i < message.zernike_m_size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(absl::StrCat("lens.zernike_m[", i, "]"), message.zernike_m(i), kZernike));
    lens.zernike_m.push_back(message.zernike_m(i));
  }
  const v1::Lens::Distortion& d = message.distortion();
  for (const auto& [name, value] :
       {std::pair("k1", d.k1()), std::pair("k2", d.k2()), std::pair("k3", d.k3()),
        std::pair("p1", d.p1()), std::pair("p2", d.p2())}) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(absl::StrCat("lens.distortion.", name), value, kLensDistortion));
  }
  lens.distortion = {d.k1(), d.k2(), d.k3(), d.p1(), d.p2()};
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("lens.sensor_tilt_x_deg", message.sensor_tilt_x_deg(), kSensorTilt));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("lens.sensor_tilt_y_deg", message.sensor_tilt_y_deg(), kSensorTilt));
  lens.sensor_tilt_x_rad = Radians(message.sensor_tilt_x_deg());
  lens.sensor_tilt_y_rad = Radians(message.sensor_tilt_y_deg());
  return ParseLensRange(message, check, lens);
}

namespace {

// Sets the vertical field of view: that which the message states, otherwise that of rows, pixel
// pitch and thin lens, otherwise the default. Where all of these are given they must agree.
absl::Status SetFieldOfView(const v1::Camera& message, const std::optional<Lens>& lens,
                            const Checker& check, Camera* camera) {
  std::optional<double> by_lens_rad;
  std::string inputs;
  if (camera->pixel_pitch_m && lens) {
    const double image_distance_m =
        lens->focus_distance_m ? 1 / (1 / lens->focal_length_m - 1 / *lens->focus_distance_m)
                               : lens->focal_length_m;
    by_lens_rad = 2 * std::atan(0.5 * camera->rows_px * *camera->pixel_pitch_m / image_distance_m);
    inputs = absl::StrCat(camera->rows_px, " rows of ", NumberText(*camera->pixel_pitch_m),
                          " m and a focal length of ", NumberText(lens->focal_length_m), " m");
    if (lens->focus_distance_m) {
      absl::StrAppend(&inputs, " focused at ", NumberText(*lens->focus_distance_m), " m");
    }
  }
  const auto rounded_deg = [](double rad) {
    return NumberText(std::round(1e3 * Degrees(rad)) / 1e3);
  };
  if (!message.has_vertical_fov_deg()) {
    if (!by_lens_rad) return absl::OkStatus();
    if (!kFieldOfView.Contains(Degrees(*by_lens_rad))) {
      return check.Error("camera", absl::StrCat("has ", inputs, ", which give a field of view of ",
                                                rounded_deg(*by_lens_rad), " deg, must be in ",
                                                kFieldOfView.ToString()));
    }
    camera->vertical_fov_rad = *by_lens_rad;
    return absl::OkStatus();
  }
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("camera.vertical_fov_deg", message.vertical_fov_deg(), kFieldOfView));
  camera->vertical_fov_rad = Radians(message.vertical_fov_deg());
  if (!by_lens_rad || std::abs(std::tan(camera->vertical_fov_rad / 2) / std::tan(*by_lens_rad / 2) -
                               1) <= kFieldOfViewAgreement) {
    return absl::OkStatus();
  }
  return check.Error(
      "camera.vertical_fov_deg",
      absl::StrCat("is ", NumberText(message.vertical_fov_deg()), ", but ", inputs, " give ",
                   rounded_deg(*by_lens_rad),
                   " deg; the tangents of half of both must agree within 10 % (or leave it out)"));
}

}  // namespace

absl::StatusOr<Camera> ParseCamera(const v1::Camera& message, const std::optional<Lens>& lens,
                                   const std::string& context) {
  const Checker check(context);
  if (!message.sensor_file().empty()) {
    return check.Error("camera.sensor_file", "cannot be read here, give camera.sensor");
  }
  Camera camera;
  std::optional<Sensor> sensor;
  if (message.has_sensor()) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        sensor, ParseSensor(message.sensor(),
                            context.empty() ? "camera.sensor" : context + ": camera.sensor"));
    camera.columns_px = sensor->columns_px;
    camera.rows_px = sensor->rows_px;
    camera.pixel_pitch_m = sensor->pixel_pitch_m;
  }
  if (message.has_columns_px()) camera.columns_px = message.columns_px();
  if (message.has_rows_px()) camera.rows_px = message.rows_px();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("camera.columns_px", camera.columns_px, kImageSize));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("camera.rows_px", camera.rows_px, kImageSize));
  if (message.has_pixel_pitch_m()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("camera.pixel_pitch_m", message.pixel_pitch_m(), kPixelPitch));
    camera.pixel_pitch_m = message.pixel_pitch_m();
  }
  if (sensor) {
    for (const auto& [name, value, of_sensor] :
         {std::tuple("columns_px", camera.columns_px, sensor->columns_px),
          std::tuple("rows_px", camera.rows_px, sensor->rows_px)}) {
      if (value <= of_sensor) continue;
      return check.Error(absl::StrCat("camera.", name),
                         absl::StrCat("is ", value, ", the sensor has only ", of_sensor));
    }
    if (std::abs(*camera.pixel_pitch_m / sensor->pixel_pitch_m - 1) > 1e-6) {
      return check.Error("camera.pixel_pitch_m",
                         absl::StrCat("is ", NumberText(*camera.pixel_pitch_m),
                                      ", that of the "
                                      "sensor is ",
                                      NumberText(sensor->pixel_pitch_m)));
    }
  }
  SIGHTLINE_RETURN_IF_ERROR(SetFieldOfView(message, lens, check, &camera));
  return camera;
}

absl::StatusOr<Laser> ParseLaser(const v1::Laser& message, const std::string& context) {
  const Checker check(context);
  Laser laser;
  if (message.has_distance_m()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("laser.distance_m", message.distance_m(), kLaserDistance));
    laser.distance_m = message.distance_m();
  }
  if (message.has_fan_angle_deg()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("laser.fan_angle_deg", message.fan_angle_deg(), kFanAngle));
    laser.fan_angle_rad = Radians(message.fan_angle_deg());
  }
  if (message.line_profile() == v1::Laser::LINE_PROFILE_GAUSSIAN) {
    laser.line_profile = LineProfile::kGaussian;
  } else if (message.line_profile() != v1::Laser::LINE_PROFILE_UNSPECIFIED &&
             message.line_profile() != v1::Laser::LINE_PROFILE_POWELL) {
    return check.Error("laser.line_profile",
                       "must be LINE_PROFILE_POWELL or LINE_PROFILE_GAUSSIAN");
  }
  if (message.has_wavelength_m()) laser.wavelength_m = message.wavelength_m();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("laser.wavelength_m", laser.wavelength_m, kLaserWavelength));
  if (message.has_power_w()) laser.power_w = message.power_w();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("laser.power_w", laser.power_w, kLaserPower));
  if (message.has_divergence_rad()) laser.divergence_rad = message.divergence_rad();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("laser.divergence_rad", laser.divergence_rad, kDivergence));
  if (message.has_beam_focus_distance_m()) {
    laser.beam_focus_distance_m = message.beam_focus_distance_m();
  }
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("laser.beam_focus_distance_m", laser.beam_focus_distance_m, kBeamFocus));
  if (message.has_beam_quality_m2()) laser.beam_quality_m2 = message.beam_quality_m2();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("laser.beam_quality_m2", laser.beam_quality_m2, kBeamQuality));
  return laser;
}

v1::Lens LensToProto(const Lens& lens) {
  v1::Lens message;
  message.set_focal_length_m(lens.focal_length_m);
  message.set_f_number(lens.f_number);
  if (lens.focus_distance_m) message.set_focus_distance_m(*lens.focus_distance_m);
  message.set_transmission(lens.transmission);
  message.set_aperture_blades(lens.aperture_blades);
  message.set_aperture_rotation_deg(Degrees(lens.aperture_rotation_rad));
  message.set_obstruction_relative(lens.obstruction_relative);
  for (const double coefficient : lens.zernike_m) message.add_zernike_m(coefficient);
  if (lens.distortion != Distortion()) {
    v1::Lens::Distortion* d = message.mutable_distortion();
    d->set_k1(lens.distortion.k1);
    d->set_k2(lens.distortion.k2);
    d->set_k3(lens.distortion.k3);
    d->set_p1(lens.distortion.p1);
    d->set_p2(lens.distortion.p2);
  }
  if (lens.sensor_tilt_x_rad != 0) message.set_sensor_tilt_x_deg(Degrees(lens.sensor_tilt_x_rad));
  if (lens.sensor_tilt_y_rad != 0) message.set_sensor_tilt_y_deg(Degrees(lens.sensor_tilt_y_rad));
  if (lens.min_f_number) message.set_min_f_number(*lens.min_f_number);
  if (lens.max_f_number) message.set_max_f_number(*lens.max_f_number);
  if (lens.min_focus_distance_m) message.set_min_focus_distance_m(*lens.min_focus_distance_m);
  return message;
}

v1::Laser ImagingLaserToProto(const Laser& laser) {
  v1::Laser message = LaserToProto(laser);
  message.set_line_profile(laser.line_profile == LineProfile::kGaussian
                               ? v1::Laser::LINE_PROFILE_GAUSSIAN
                               : v1::Laser::LINE_PROFILE_POWELL);
  message.set_wavelength_m(laser.wavelength_m);
  message.set_power_w(laser.power_w);
  message.set_divergence_rad(laser.divergence_rad);
  message.set_beam_focus_distance_m(laser.beam_focus_distance_m);
  message.set_beam_quality_m2(laser.beam_quality_m2);
  return message;
}

absl::Status ParseImaging(const v1::Inspection& message, const std::string& context,
                          Inspection* inspection) {
  const Checker check(context);
  if (message.camera().has_sensor()) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        inspection->sensor,
        ParseSensor(message.camera().sensor(),
                    context.empty() ? "camera.sensor" : context + ": camera.sensor"));
    const v1::Sensor& file = message.camera().sensor();
    if (file.has_min_exposure_time_s())
      inspection->min_exposure_time_s = file.min_exposure_time_s();
    if (file.has_max_exposure_time_s())
      inspection->max_exposure_time_s = file.max_exposure_time_s();
  }
  std::set<std::string> surfaces;
  for (int i = 0; i < message.materials_size(); ++i) {
    const v1::MaterialAssignment& assignment = message.materials(i);
    if (!surfaces.insert(assignment.part_material()).second) {
      return check.Error(
          absl::StrCat("materials[", i, "].part_material"),
          absl::StrCat("is \"", assignment.part_material(), "\" like that of another assignment"));
    }
    inspection->materials.push_back({assignment.part_material(), assignment.material()});
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckLighting(message.lighting(), check));
  inspection->lighting = message.lighting();
  SIGHTLINE_ASSIGN_OR_RETURN(inspection->render, ParseRenderSettings(message.render(), check));
  std::set<std::string> effects;
  for (int i = 0; i < message.effects_size(); ++i) {
    const v1::Effect& effect = message.effects(i);
    const std::string path = absl::StrCat("effects[", i, "].effect");
    if (effect.effect().empty()) return check.Error(path, "is missing");
    if (!effects.insert(effect.effect()).second) {
      return check.Error(path, absl::StrCat("is \"", effect.effect(), "\" a second time"));
    }
    inspection->effects.push_back(
        {effect.effect(), {effect.parameters().begin(), effect.parameters().end()}});
  }
  return absl::OkStatus();
}

}  // namespace sightline
