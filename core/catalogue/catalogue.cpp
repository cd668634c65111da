// SPDX-License-Identifier: Apache-2.0
#include "core/catalogue/catalogue.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <system_error>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/field_limits/field_checks.h"
#include "core/field_limits/imaging_limits.h"
#include "core/inspection/imaging.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr size_t kMaxFiles = 1000;

constexpr Limits kSensorDistance{0, 10, " m", true};
constexpr Limits kLineWidth{0, 10, " m", true};
constexpr Limits kPointsPerProfile{16, 16384, ""};
constexpr Limits kProfileWavelength{200e-9, 2000e-9, " m"};
constexpr Limits kProfileAngle{10, 80, " degrees"};
constexpr Limits kImageCircle{1e-3, 0.2, " m"};
constexpr Limits kFrameRate{0, 1e6, " Hz", true};
// A price of 0 would read as "not known" in a device choice.
constexpr Limits kPrice{0, 1e7, " EUR", true};

const std::vector<std::string>& SafetyClasses() {
  static const auto* const kClasses =
      new std::vector<std::string>{"1", "1M", "2", "2M", "3R", "3B", "4"};
  return *kClasses;
}

absl::Status CheckOneOf(const Checker& check, const std::string& field, const std::string& value,
                        const std::vector<std::string>& known) {
  if (std::find(known.begin(), known.end(), value) != known.end()) return absl::OkStatus();
  const std::string allowed = absl::StrCat("must be one of ", absl::StrJoin(known, ", "));
  if (value.empty()) return check.Error(field, absl::StrCat("is missing, ", allowed));
  return check.Error(field, absl::StrCat("is \"", value, "\", ", allowed));
}

template <typename Message>
absl::StatusOr<std::optional<double>> ParsePrice(const Message& message, const Checker& check) {
  if (!message.has_price_eur()) return std::optional<double>();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("price_eur", message.price_eur(), kPrice));
  return std::optional<double>(message.price_eur());
}

absl::StatusOr<DeviceCamera> ReadDevice(const v1::Sensor& message, const std::string& file) {
  const Checker check(file);
  DeviceCamera camera;
  SIGHTLINE_ASSIGN_OR_RETURN(camera.sensor, ParseSensor(message, file));
  camera.mount = message.mount();
  SIGHTLINE_RETURN_IF_ERROR(CheckOneOf(check, "mount", camera.mount, KnownMounts()));
  if (message.has_max_frame_rate_hz()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("max_frame_rate_hz", message.max_frame_rate_hz(), kFrameRate));
    camera.max_frame_rate_hz = message.max_frame_rate_hz();
  }
  SIGHTLINE_ASSIGN_OR_RETURN(camera.price_eur, ParsePrice(message, check));
  return camera;
}

absl::Status ParseLensNumbers(const v1::CatalogueLens& message, const Checker& check,
                              DeviceLens* device) {
  for (const auto& [given, name] : {std::pair(message.has_focal_length_m(), "focal_length_m"),
                                    std::pair(message.has_min_f_number(), "min_f_number"),
                                    std::pair(message.has_max_f_number(), "max_f_number")}) {
    if (!given) return check.Error(name, "is missing");
  }
  const double focal_length_m = message.focal_length_m();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("focal_length_m", focal_length_m, kLensFocalLength));
  device->min_f_number = message.min_f_number();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("min_f_number", device->min_f_number, kLensFNumber));
  device->max_f_number = message.max_f_number();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("max_f_number", device->max_f_number,
                                        {device->min_f_number, kLensFNumber.max, ""}));
  if (message.has_min_focus_distance_m()) {
    // Nearer there is no real image.
    SIGHTLINE_RETURN_IF_ERROR(check.Range("min_focus_distance_m", message.min_focus_distance_m(),
                                          {1.01 * focal_length_m, 1000, " m"}));
    device->min_focus_distance_m = message.min_focus_distance_m();
  }
  if (message.has_image_circle_m()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("image_circle_m", message.image_circle_m(), kImageCircle));
    device->image_circle_m = message.image_circle_m();
  }
  Lens& lens = device->lens;
  lens.focal_length_m = focal_length_m;
  lens.f_number = device->min_f_number;
  lens.min_f_number = device->min_f_number;
  lens.max_f_number = device->max_f_number;
  lens.min_focus_distance_m = device->min_focus_distance_m;
  if (message.has_transmission()) {
    lens.transmission = message.transmission();
    SIGHTLINE_RETURN_IF_ERROR(check.Range("transmission", lens.transmission, kLensTransmission));
  }
  lens.aperture_blades = message.aperture_blades();
  if (lens.aperture_blades != 0) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("aperture_blades", lens.aperture_blades, kApertureBlades));
  }
  const v1::Lens::Distortion& d = message.distortion();
  for (const auto& [name, value] :
       {std::pair("k1", d.k1()), std::pair("k2", d.k2()), std::pair("k3", d.k3()),
        std::pair("p1", d.p1()), std::pair("p2", d.p2())}) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(absl::StrCat("distortion.", name), value, kLensDistortion));
  }
  lens.distortion = {d.k1(), d.k2(), d.k3(), d.p1(), d.p2()};
  return absl::OkStatus();
}

absl::StatusOr<DeviceLens> ReadDevice(const v1::CatalogueLens& message, const std::string& file) {
  const Checker check(file);
  DeviceLens lens;
  lens.name = message.name();
  lens.mount = message.mount();
  SIGHTLINE_RETURN_IF_ERROR(CheckOneOf(check, "mount", lens.mount, KnownMounts()));
  SIGHTLINE_RETURN_IF_ERROR(ParseLensNumbers(message, check, &lens));
  SIGHTLINE_ASSIGN_OR_RETURN(lens.price_eur, ParsePrice(message, check));
  return lens;
}

absl::StatusOr<DeviceLaser> ReadDevice(const v1::CatalogueLaser& message, const std::string& file) {
  const Checker check(file);
  DeviceLaser device;
  device.name = message.name();
  const v1::Laser& laser = message.laser();
  // An inspection falls back on the laser of the thesis; another device is not that one.
  for (const auto& [given, name] :
       {std::pair(laser.has_fan_angle_deg(), "fan_angle_deg"),
        std::pair(laser.has_wavelength_m(), "wavelength_m"),
        std::pair(laser.has_power_w(), "power_w"),
        std::pair(laser.has_divergence_rad(), "divergence_rad"),
        std::pair(laser.has_beam_focus_distance_m(), "beam_focus_distance_m")}) {
    if (!given) return check.Error(absl::StrCat("laser.", name), "is missing");
  }
  if (laser.has_distance_m()) {
    return check.Error("laser.distance_m", "is given, but where a laser stands is the rig's");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(device.laser, ParseLaser(laser, file));
  device.safety_class = message.safety_class();
  if (!device.safety_class.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(
        CheckOneOf(check, "safety_class", device.safety_class, SafetyClasses()));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(device.price_eur, ParsePrice(message, check));
  return device;
}

absl::StatusOr<DeviceProfileSensor> ReadDevice(const v1::CatalogueProfileSensor& message,
                                               const std::string& file) {
  const Checker check(file);
  DeviceProfileSensor device;
  device.name = message.name();
  for (const auto& [given, name] :
       {std::pair(message.has_near_distance_m(), "near_distance_m"),
        std::pair(message.has_far_distance_m(), "far_distance_m"),
        std::pair(message.has_near_width_m(), "near_width_m"),
        std::pair(message.has_far_width_m(), "far_width_m"),
        std::pair(message.has_points_per_profile(), "points_per_profile")}) {
    if (!given) return check.Error(name, "is missing");
  }
  device.near_distance_m = message.near_distance_m();
  device.far_distance_m = message.far_distance_m();
  device.near_width_m = message.near_width_m();
  device.far_width_m = message.far_width_m();
  device.points_per_profile = message.points_per_profile();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("near_distance_m", device.near_distance_m, kSensorDistance));
  Limits beyond = kSensorDistance;
  beyond.min = device.near_distance_m;
  SIGHTLINE_RETURN_IF_ERROR(check.Range("far_distance_m", device.far_distance_m, beyond));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("near_width_m", device.near_width_m, kLineWidth));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("far_width_m", device.far_width_m, kLineWidth));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("points_per_profile", device.points_per_profile, kPointsPerProfile));
  if (message.has_wavelength_m()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("wavelength_m", message.wavelength_m(), kProfileWavelength));
    device.wavelength_m = message.wavelength_m();
  }
  if (message.has_triangulation_angle_deg()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("triangulation_angle_deg", message.triangulation_angle_deg(), kProfileAngle));
    device.triangulation_angle_rad = Radians(message.triangulation_angle_deg());
  }
  device.safety_class = message.safety_class();
  if (!device.safety_class.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(
        CheckOneOf(check, "safety_class", device.safety_class, SafetyClasses()));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(device.price_eur, ParsePrice(message, check));
  return device;
}

// The files of one kind, sorted by name. `what`: as in "cameras/ holds no camera file".
absl::StatusOr<std::vector<std::string>> FilesOf(const std::string& folder, const char* kind,
                                                 const char* what, bool may_be_none) {
  namespace fs = std::filesystem;
  const fs::path path = fs::path(folder) / kind;
  std::vector<std::string> names;
  std::error_code error;
  if (fs::is_directory(path, error)) {
    for (fs::directory_iterator entry(path, error); !error && entry != fs::directory_iterator();
         entry.increment(error)) {
      const std::string name = entry->path().filename().string();
      if (absl::StartsWith(name, ".") || entry->path().extension() != ".json") continue;
      std::error_code ignored;
      if (entry->is_regular_file(ignored)) names.push_back(name);
    }
    if (error) {
      return absl::NotFoundError(
          absl::StrCat(path.string(), ": cannot be read: ", error.message()));
    }
  }
  const Checker check(folder);
  const std::string subfolder = absl::StrCat(kind, "/");
  if (names.empty() && !may_be_none)
    return check.Error(subfolder, absl::StrCat("holds no ", what, " file"));
  if (names.size() > kMaxFiles) {
    return check.Error(
        subfolder, absl::StrCat("holds ", names.size(), " ", what, " files, at most ", kMaxFiles));
  }
  std::sort(names.begin(), names.end());
  for (std::string& name : names) name = (path / name).string();
  return names;
}

template <typename Message, typename Device>
absl::Status ReadKind(const std::string& folder, const char* kind, const char* what,
                      std::vector<Device>* devices, bool may_be_none = false) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto files, FilesOf(folder, kind, what, may_be_none));
  std::map<std::string, std::string> file_of_name;
  for (const std::string& file : files) {
    Message message;
    SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(file, &message));
    const Checker check(file);
    if (message.name().empty()) return check.Error("name", "is missing");
    const auto [other, added] = file_of_name.emplace(message.name(), file);
    if (!added) {
      return check.Error("name",
                         absl::StrCat("is \"", message.name(), "\" like that of ", other->second));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(Device device, ReadDevice(message, file));
    device.file = file;
    device.message = std::move(message);
    devices->push_back(std::move(device));
  }
  return absl::OkStatus();
}

}  // namespace

const std::vector<std::string>& KnownMounts() {
  static const auto* const kMounts =
      new std::vector<std::string>{"C", "CS", "S", "F", "EF", "M42", "M58", "TFL"};
  return *kMounts;
}

absl::StatusOr<Catalogue> ReadCatalogue(const std::string& folder) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) {
    return absl::NotFoundError(absl::StrCat(folder, ": there is no such folder"));
  }
  Catalogue catalogue;
  SIGHTLINE_RETURN_IF_ERROR(ReadKind<v1::Sensor>(folder, "cameras", "camera", &catalogue.cameras));
  SIGHTLINE_RETURN_IF_ERROR(
      ReadKind<v1::CatalogueLens>(folder, "lenses", "lens", &catalogue.lenses));
  SIGHTLINE_RETURN_IF_ERROR(
      ReadKind<v1::CatalogueLaser>(folder, "lasers", "laser", &catalogue.lasers));
  SIGHTLINE_RETURN_IF_ERROR(ReadKind<v1::CatalogueProfileSensor>(
      folder, "profile_sensors", "profile sensor", &catalogue.profile_sensors, true));
  return catalogue;
}

}  // namespace sightline
