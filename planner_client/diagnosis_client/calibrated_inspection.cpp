// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/calibrated_inspection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using google::protobuf::Message;

constexpr double kSame = 1e-3;
// Part of its standard uncertainty below which a deviation is left out.
constexpr double kNegligible = 0.01;
constexpr double kDefaultWavelength_m = 661e-9;
constexpr char kAmbientLight[] = "illumination.ambient_light";
constexpr char kSetUp[] =
    ": is of the set-up of the recordings, not of camera, lens or laser: left out";

bool Same(double a, double b) { return std::abs(a - b) <= kSame * std::abs(b); }

bool IsOfSetUp(const std::string& effect) {
  return effect == "geometry.camera_distance_error" || effect == "geometry.laser_distance_error" ||
         effect == "geometry.incidence_angle_error";
}

// Reflectance of the plate for even light from everywhere, seen along its normal: the integral of
// f_r cos(theta) over the half space (recordings format, section 3; Helmholtz reciprocity).
double HemisphericalReflectance(const v1::Recordings::PlateSurface& surface) {
  constexpr int kSteps = 2000;
  const double alpha2 = surface.ggx_alpha() * surface.ggx_alpha();
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double theta = (i + 0.5) / kSteps * std::numbers::pi / 2;
    const double ch = std::cos(theta / 2), tangent = std::tan(theta);
    const double d = alpha2 / (std::numbers::pi * std::pow(ch * ch * (alpha2 - 1) + 1, 2));
    const double f = surface.specular_f0() + (1 - surface.specular_f0()) * std::pow(1 - ch, 5);
    const double g = 2 / (1 + std::sqrt(1 + alpha2 * tangent * tangent));
    sum += d * f * g / 4 * std::sin(theta);
  }
  return surface.diffuse_albedo() + std::numbers::pi * std::numbers::pi / kSteps * sum;
}

class Calibration : private InspectionChanges {
 public:
  Calibration(const v1::Recordings& nominal, CalibratedInspection* result)
      : InspectionChanges(result), nominal_(nominal), inspection_(result->inspection) {
    const v1::Sensor& stated = inspection_.camera().sensor();
    const v1::Sensor& recorded = nominal.camera();
    has_sensor_ = inspection_.camera().has_sensor() &&
                  stated.sensor_type() == recorded.sensor_type() &&
                  stated.sensor_columns_px() == recorded.sensor_columns_px() &&
                  stated.sensor_rows_px() == recorded.sensor_rows_px() &&
                  stated.bit_depth_bit() == recorded.bit_depth_bit() &&
                  Same(stated.pixel_pitch_m(), recorded.pixel_pitch_m());
    for (int i = 0; i < inspection_.materials_size(); ++i) {
      const v1::Material& material = inspection_.materials(i).material();
      if (material.has_lambert_ggx() &&
          Same(material.lambert_ggx().diffuse_albedo(), nominal.surface().diffuse_albedo()) &&
          Same(material.lambert_ggx().specular_f0(), nominal.surface().specular_f0()) &&
          Same(material.lambert_ggx().ggx_alpha(), nominal.surface().ggx_alpha())) {
        plate_materials_.push_back(i);
      }
    }
    has_lens_ = inspection_.has_lens() &&
                Same(inspection_.lens().focal_length_m(), nominal.lens().focal_length_m());
    has_laser_ = Same(inspection_.laser().has_wavelength_m() ? inspection_.laser().wavelength_m()
                                                             : kDefaultWavelength_m,
                      nominal.laser().wavelength_m());
  }

  void ApplyDeviation(const std::string& name, double value);
  void ApplyEffect(const v1::Effect& effect);
  // A surface cannot reflect more than it receives: what of the light is more than that is the
  // laser's, since only their product is known.
  void KeepReflectanceBelowOne();

 private:
  v1::Sensor* sensor() { return inspection_.mutable_camera()->mutable_sensor(); }
  v1::Lens* lens() { return inspection_.mutable_lens(); }
  v1::Laser* laser() { return inspection_.mutable_laser(); }

  // Whether the inspection has what `source` changes.
  bool Check(bool there, const char* what, const std::string& source) {
    if (!there)
      Warn(absl::StrCat(source, ": ", what,
                        " of the inspection is that of the recordings: left as it is"));
    return there;
  }
  bool HasSensor(const std::string& source) { return Check(has_sensor_, "no sensor", source); }
  bool HasLens(const std::string& source) { return Check(has_lens_, "no lens", source); }
  bool HasLaser(const std::string& source) { return Check(has_laser_, "no laser", source); }

  // Factors of red (or mono), green, blue.
  void ScaleEfficiency(const std::array<double, 3>& factors, const std::string& source);
  // Changes the materials that are the plate's.
  void ScaleMaterials(double albedo_factor, double f0_factor, double alpha_factor,
                      const std::string& source);
  void SetAmbient(const std::map<std::string, double>& parameters, const std::string& source);
  // False: the inspection has no field for it.
  bool ApplyToFields(const std::string& id, const std::map<std::string, double>& parameters);

  const v1::Recordings& nominal_;
  v1::Inspection& inspection_;
  bool has_sensor_ = false, has_lens_ = false, has_laser_ = false;
  std::vector<int> plate_materials_;  // those that state the plate's surface
};

void Calibration::ScaleEfficiency(const std::array<double, 3>& factors, const std::string& source) {
  const bool mono = nominal_.camera().sensor_type() == "mono";
  const auto scale = [&](Message* efficiency, const std::string& path) {
    const std::array<const char*, 3> colours = {mono ? "mono" : "red", "green", "blue"};
    for (int c = 0; c < (mono ? 1 : 3); ++c) {
      const Number number{efficiency, colours[c], 0, 0, 1};
      if (factors[c] != 1 &&
          efficiency->GetReflection()->HasField(*efficiency, number.Descriptor())) {
        Scale(number, path, factors[c], source);
      }
    }
  };
  if (sensor()->has_quantum_efficiency()) {
    scale(sensor()->mutable_quantum_efficiency(), "camera.sensor.quantum_efficiency.");
  }
  for (int i = 0; i < sensor()->quantum_efficiency_curve_size(); ++i) {
    scale(sensor()->mutable_quantum_efficiency_curve(i),
          absl::StrCat("camera.sensor.quantum_efficiency_curve[", i, "]."));
  }
}

void Calibration::ScaleMaterials(double albedo_factor, double f0_factor, double alpha_factor,
                                 const std::string& source) {
  if (!Check(!plate_materials_.empty(), "no material", source)) return;
  for (const int i : plate_materials_) {
    v1::Material::LambertGgx* surface =
        inspection_.mutable_materials(i)->mutable_material()->mutable_lambert_ggx();
    const std::string path = absl::StrCat("materials[", i, "].material.lambert_ggx.");
    if (albedo_factor != 1) {
      Scale({surface, "diffuse_albedo", 0, 0, 1}, path, albedo_factor, source);
    }
    if (f0_factor != 1) {
      Scale({surface, "specular_f0", 0, 0, 1}, path, f0_factor, source);
    }
    if (alpha_factor != 1) {
      Scale({surface, "ggx_alpha", 1, 1e-3, 1}, path, alpha_factor, source);
    }
  }
}

void Calibration::KeepReflectanceBelowOne() {
  double largest = 0;
  for (const int i : plate_materials_) {
    const auto& surface = inspection_.materials(i).material().lambert_ggx();
    largest = std::max(largest, surface.diffuse_albedo() + surface.specular_f0());
  }
  if (largest <= 1 || !has_laser_) return;
  const std::string source = "reflectance of at most 1";
  constexpr double kRounding = 1 - 1e-12;
  ScaleMaterials(kRounding / largest, kRounding / largest, 1, source);
  Scale({laser(), "power_w", 0.023, 0, 100}, "laser.", largest, source);
}

void Calibration::SetAmbient(const std::map<std::string, double>& parameters,
                             const std::string& source) {
  const double radiance =
      parameters.at("ambient_radiance_w_m2_sr") / HemisphericalReflectance(nominal_.surface());
  const double wavelength = nominal_.laser().wavelength_m();
  v1::Lighting* lighting = inspection_.mutable_lighting();
  const bool lit = lighting->ambient().radiance_w_m2_sr() > 0;
  if (lit && !(lighting->ambient().spectrum().has_line() &&
               Same(lighting->ambient().spectrum().line().wavelength_m(), wavelength))) {
    Warn(absl::StrCat(source, ": lighting.ambient is given with another spectrum: left as it is"));
    return;
  }
  for (const char* gradient : {"gradient_u_relative", "gradient_v_relative"}) {
    if (const auto found = parameters.find(gradient);
        found != parameters.end() && found->second != 0) {
      Warn(absl::StrCat(source, ": its ", gradient, " of ", NumberText(found->second),
                        " cannot be said for a part: left out"));
    }
  }
  lighting->mutable_ambient()->mutable_spectrum()->mutable_line()->set_wavelength_m(wavelength);
  Shift({lighting->mutable_ambient(), "radiance_w_m2_sr", 0, 0, 1e6}, "lighting.ambient.", radiance,
        source);
}

void Calibration::ApplyDeviation(const std::string& name, double value) {
  const auto relative = [&](Message* message, const char* field, double unset, double upper,
                            const char* path) {
    Scale({message, field, unset, 1e-12, upper}, path, 1 + value, name);
  };
  if (name == "f_number_relative") {
    if (!HasLens(name)) return;
    Scale({lens(), "f_number", 8, 0.5, 128}, "lens.", 1 + value, name);
  } else if (name == "focus_distance_relative") {
    if (!HasLens(name)) return;
    if (!lens()->has_focus_distance_m()) {
      Warn(absl::StrCat(name,
                        ": lens.focus_distance_m is not given (the lens is focused on the "
                        "rig's origin): left as it is"));
      return;
    }
    relative(lens(), "focus_distance_m", 1, 1000, "lens.");
  } else if (name == "transmission_relative") {
    if (HasLens(name)) relative(lens(), "transmission", 1, 1, "lens.");
  } else if (name == "power_relative") {
    if (HasLaser(name)) relative(laser(), "power_w", 0.023, 100, "laser.");
  } else if (name == "divergence_relative") {
    if (HasLaser(name)) relative(laser(), "divergence_rad", 0.24e-3, 0.5, "laser.");
  } else if (name == "beam_focus_distance_m") {
    if (!HasLaser(name)) return;
    Shift({laser(), "beam_focus_distance_m", 0.9, 0, 100}, "laser.", value, name);
  } else if (name == "diffuse_albedo_relative") {
    ScaleMaterials(1 + value, 1, 1, name);
  } else if (name == "specular_f0_relative") {
    ScaleMaterials(1, 1 + value, 1, name);
  } else if (name == "ggx_alpha_relative") {
    ScaleMaterials(1, 1, 1 + value, name);
  } else if (name == "quantum_efficiency_relative") {
    if (HasSensor(name)) ScaleEfficiency({1 + value, 1 + value, 1 + value}, name);
  } else if (name == "gain_relative") {
    if (HasSensor(name)) relative(sensor(), "gain_dn_per_electron", 1, 1e6, "camera.sensor.");
  } else if (name == "dark_mean_electrons") {
    if (!HasSensor(name)) return;
    Shift({sensor(), "dark_mean_electrons", 0, 0, 1e9}, "camera.sensor.", value, name);
  } else if (name == "dark_noise_relative") {
    if (HasSensor(name)) relative(sensor(), "dark_noise_electrons", 0, 1e9, "camera.sensor.");
  } else if (name != "line_position_common_px") {
    Warn(name + kSetUp);
  }
}

bool Calibration::ApplyToFields(const std::string& id,
                                const std::map<std::string, double>& parameters) {
  // Left out: without effect.
  const auto value = [&](const char* name, double null_value) {
    const auto found = parameters.find(name);
    return found == parameters.end() ? null_value : found->second;
  };
  if (id == "illumination.power_error") {
    Scale({laser(), "power_w", 0.023, 0, 100}, "laser.", value("amplitude_factor", 1), id);
  } else if (id == "illumination.beam_quality") {
    Scale({laser(), "beam_quality_m2", 1, 1, 1000}, "laser.", value("m2", 1), id);
  } else if (id == "illumination.beam_focus") {
    Shift({laser(), "beam_focus_distance_m", 0.9, 0, 100}, "laser.", value("beam_focus_shift_m", 0),
          id);
  } else if (id == "illumination.wavelength_error") {
    Shift({laser(), "wavelength_m", kDefaultWavelength_m, 200e-9, 2000e-9}, "laser.",
          value("wavelength_shift_m", 0), id);
  } else if (id == kAmbientLight) {
    if (parameters.count("ambient_radiance_w_m2_sr") > 0) SetAmbient(parameters, id);
  } else if (id == "optics.f_number_error") {
    Scale({lens(), "f_number", 8, 0.5, 128}, "lens.", value("f_number_factor", 1), id);
  } else if (id == "optics.transmission_error" &&
             (lens()->has_transmission() ? lens()->transmission() : 1) *
                     value("amplitude_factor", 1) <=
                 1) {
    Scale({lens(), "transmission", 1, 1e-12, 1}, "lens.", value("amplitude_factor", 1), id);
  } else if (id == "optics.focus_error" && lens()->has_focus_distance_m()) {
    Scale({lens(), "focus_distance_m", 1, 1e-3, 1000}, "lens.", value("focus_distance_factor", 1),
          id);
  } else if (id == "sensor.gain_error") {
    Scale({sensor(), "gain_dn_per_electron", 1, 1e-12, 1e6}, "camera.sensor.",
          value("gain_factor", 1), id);
  } else if (id == "sensor.dark_current") {
    Shift({sensor(), "dark_current_electrons_per_s", 0, 0, 1e9}, "camera.sensor.",
          value("dark_current_electrons_per_s", 0), id);
  } else if (id == "sensor.black_level_error") {
    Shift({sensor(), "dark_mean_electrons", 0, 0, 1e9}, "camera.sensor.",
          value("black_level_shift_electrons", 0), id);
  } else if (id == "sensor.read_noise_excess") {
    Scale({sensor(), "dark_noise_electrons", 0, 0, 1e9}, "camera.sensor.", value("noise_factor", 1),
          id);
  } else if (id == "sensor.qe_error") {
    ScaleEfficiency(
        {value("qe_factor", 1), value("qe_factor_green", 1), value("qe_factor_blue", 1)}, id);
  } else if (id == "sensor.colour_response_error") {
    ScaleEfficiency({1, value("qe_factor_green", 1), value("qe_factor_blue", 1)}, id);
  } else if (id == "surface.albedo_error") {
    const double factor = value("amplitude_factor", 1);
    ScaleMaterials(factor, factor, 1, id);
  } else if (id == "surface.brdf_error") {
    ScaleMaterials(1, 1, value("alpha_factor", 1), id);
  } else {
    return false;
  }
  return true;
}

void Calibration::ApplyEffect(const v1::Effect& effect) {
  const std::string& id = effect.effect();
  if (id != kAmbientLight && absl::StartsWith(id, "illumination.") && !HasLaser(id)) return;
  if (absl::StartsWith(id, "optics.") && !HasLens(id)) return;
  if (absl::StartsWith(id, "sensor.") && !HasSensor(id)) return;
  if (IsOfSetUp(id)) {
    Warn(id + kSetUp);
    return;
  }
  if (ApplyToFields(id, {effect.parameters().begin(), effect.parameters().end()})) return;
  if (ActsOnPlatesOnly(id)) {
    Warn(absl::StrCat(id, ": acts on a flat plate only, an inspection cannot say it: left out"));
    return;
  }
  AddEffect(effect);
}

}  // namespace

bool ActsOnPlatesOnly(const std::string& effect) {
  constexpr std::array<const char*, 15> kOnPlates = {"illumination.ambient_light",
                                                     "illumination.beam_shape",
                                                     "illumination.ghost_line",
                                                     "illumination.line_bow",
                                                     "illumination.line_nonuniformity",
                                                     "geometry.laser_roll",
                                                     "surface.albedo_error",
                                                     "surface.albedo_texture",
                                                     "surface.brdf_error",
                                                     "surface.curved_plate",
                                                     "surface.fluorescence",
                                                     "surface.subsurface_scattering",
                                                     "surface.tilted_plate",
                                                     "time.ambient_flicker",
                                                     "geometry.camera_roll"};
  return std::find(kOnPlates.begin(), kOnPlates.end(), effect) != kOnPlates.end();
}

CalibratedInspection CalibrateInspection(const v1::Inspection& inspection,
                                         const v1::Recordings& nominal,
                                         const v1::Diagnosis& diagnosis) {
  CalibratedInspection result;
  result.inspection = inspection;
  Calibration calibration(nominal, &result);
  // Deviations of the order of nothing would only fill the list.
  for (const v1::FittedDeviation& deviation : diagnosis.model_fit().deviations()) {
    if (!std::isfinite(deviation.value()) ||
        std::abs(deviation.value()) <= kNegligible * deviation.standard_uncertainty()) {
      continue;
    }
    calibration.ApplyDeviation(deviation.name(), deviation.value());
  }
  for (const v1::Effect& effect : diagnosis.calibrated_effects()) calibration.ApplyEffect(effect);
  calibration.KeepReflectanceBelowOne();
  return result;
}

absl::StatusOr<CalibratedInspection> CalibrateInspectionFile(const std::string& path,
                                                             const v1::Recordings& nominal,
                                                             const v1::Diagnosis& diagnosis,
                                                             const std::string& out_folder) {
  v1::Inspection message;
  absl::Status status = ReadStrictJsonFile(path, &message);
  if (!status.ok()) return status;
  const fs::path base = fs::absolute(path).lexically_normal().parent_path();
  absl::StatusOr<v1::Inspection> inlined = InlineInspectionFiles(message, path, base.string());
  if (!inlined.ok()) return inlined.status();
  status = ParseInspection(*inlined, path, "").status();
  if (!status.ok()) return status;
  CalibratedInspection result = CalibrateInspection(*inlined, nominal, diagnosis);
  status = ParseInspection(result.inspection, absl::StrCat(path, ", calibrated"), "").status();
  if (!status.ok()) return status;
  NameFilesFrom(out_folder, &result.inspection);
  return result;
}

}  // namespace sightline
