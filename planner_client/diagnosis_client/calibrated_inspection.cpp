// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/calibrated_inspection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr double kSame = 1e-3;
// A deviation below this fraction of its standard uncertainty is left out.
constexpr double kNegligible = 0.01;
constexpr double kDefaultWavelength_m = 661e-9;

bool Same(double a, double b) { return std::abs(a - b) <= kSame * std::abs(b); }

// Components of an inspection, as v1::InspectionChange names them.
struct Component {
  std::string_view name;
  const char* in_words;
};
constexpr Component kSensor{"camera.sensor", "no sensor"};
constexpr Component kLens{"lens", "no lens"};
constexpr Component kLaser{"laser", "no laser"};
constexpr Component kMaterials{"materials", "no material"};
constexpr std::array kComponents = {kSensor, kLens, kLaser, kMaterials};

// Field of an inspection that a fitted quantity of the set-up changes.
struct DeviationField {
  std::string_view name;  // as in `uncertainty` of the recordings
  Component component;
  const char* path;
  bool is_relative = true;  // else the value is added
};
constexpr std::array kDeviationFields = {
    DeviationField{"f_number_relative", kLens, "lens.f_number"},
    DeviationField{"focus_distance_relative", kLens, "lens.focus_distance_m"},
    DeviationField{"transmission_relative", kLens, "lens.transmission"},
    DeviationField{"power_relative", kLaser, "laser.power_w"},
    DeviationField{"divergence_relative", kLaser, "laser.divergence_rad"},
    DeviationField{"beam_focus_distance_m", kLaser, "laser.beam_focus_distance_m", false},
    DeviationField{"diffuse_albedo_relative", kMaterials,
                   "materials.material.lambert_ggx.diffuse_albedo"},
    DeviationField{"specular_f0_relative", kMaterials,
                   "materials.material.lambert_ggx.specular_f0"},
    DeviationField{"ggx_alpha_relative", kMaterials, "materials.material.lambert_ggx.ggx_alpha"},
    DeviationField{"quantum_efficiency_relative", kSensor, "camera.sensor.quantum_efficiency.mono"},
    DeviationField{"quantum_efficiency_relative", kSensor, "camera.sensor.quantum_efficiency.red"},
    DeviationField{"quantum_efficiency_relative", kSensor,
                   "camera.sensor.quantum_efficiency.green"},
    DeviationField{"quantum_efficiency_relative", kSensor, "camera.sensor.quantum_efficiency.blue"},
    DeviationField{"quantum_efficiency_relative", kSensor,
                   "camera.sensor.quantum_efficiency_curve.mono"},
    DeviationField{"quantum_efficiency_relative", kSensor,
                   "camera.sensor.quantum_efficiency_curve.red"},
    DeviationField{"quantum_efficiency_relative", kSensor,
                   "camera.sensor.quantum_efficiency_curve.green"},
    DeviationField{"quantum_efficiency_relative", kSensor,
                   "camera.sensor.quantum_efficiency_curve.blue"},
    DeviationField{"gain_relative", kSensor, "camera.sensor.gain_dn_per_electron"},
    DeviationField{"dark_mean_electrons", kSensor, "camera.sensor.dark_mean_electrons", false},
    DeviationField{"dark_noise_relative", kSensor, "camera.sensor.dark_noise_electrons"},
};
// The line's position is fitted in every image and is irrelevant to an inspection.
constexpr std::string_view kLinePosition = "line_position_common_px";

class Calibration {
 public:
  Calibration(const v1::Recordings& nominal, CalibratedInspection* result)
      : changes_(result), inspection_(result->inspection) {
    const v1::Sensor& stated = inspection_.camera().sensor();
    const v1::Sensor& recorded = nominal.camera();
    if (inspection_.camera().has_sensor() && stated.sensor_type() == recorded.sensor_type() &&
        stated.sensor_columns_px() == recorded.sensor_columns_px() &&
        stated.sensor_rows_px() == recorded.sensor_rows_px() &&
        stated.bit_depth_bit() == recorded.bit_depth_bit() &&
        Same(stated.pixel_pitch_m(), recorded.pixel_pitch_m())) {
      recorded_.push_back(kSensor.name);
    }
    for (int i = 0; i < inspection_.materials_size(); ++i) {
      const v1::Material& material = inspection_.materials(i).material();
      if (material.has_lambert_ggx() &&
          Same(material.lambert_ggx().diffuse_albedo(), nominal.surface().diffuse_albedo()) &&
          Same(material.lambert_ggx().specular_f0(), nominal.surface().specular_f0()) &&
          Same(material.lambert_ggx().ggx_alpha(), nominal.surface().ggx_alpha())) {
        plate_materials_.push_back(i);
      }
    }
    changes_.set_plate_materials(plate_materials_);
    if (!plate_materials_.empty()) recorded_.push_back(kMaterials.name);
    if (inspection_.has_lens() &&
        Same(inspection_.lens().focal_length_m(), nominal.lens().focal_length_m())) {
      recorded_.push_back(kLens.name);
    }
    if (Same(inspection_.laser().has_wavelength_m() ? inspection_.laser().wavelength_m()
                                                    : kDefaultWavelength_m,
             nominal.laser().wavelength_m())) {
      recorded_.push_back(kLaser.name);
    }
  }

  void ApplyDeviation(const std::string& name, double value) {
    bool known = name == kLinePosition;
    for (const DeviationField& field : kDeviationFields) {
      if (field.name != name) continue;
      known = true;
      if (!IsRecorded(field.component.name, name)) return;
      if (field.is_relative) {
        changes_.Scale(field.path, 1 + value, name);
      } else {
        changes_.Shift(field.path, value, name);
      }
    }
    if (!known) changes_.Warn(name + kOfSetUp);
  }

  void ApplyEffect(const v1::Effect& effect, const std::vector<v1::InspectionChange>& changes) {
    for (const v1::InspectionChange& change : changes) {
      if (!change.component().empty() && !IsRecorded(change.component(), effect.effect())) return;
    }
    changes_.Carry(effect, changes);
  }

  // A surface cannot reflect more than it receives: the excess is assigned to the laser, since only
  // the product of both is known.
  void KeepReflectanceBelowOne() {
    double largest = 0;
    for (const int i : plate_materials_) {
      const auto& surface = inspection_.materials(i).material().lambert_ggx();
      largest = std::max(largest, surface.diffuse_albedo() + surface.specular_f0());
    }
    if (largest <= 1 || !Contains(kLaser.name)) return;
    const std::string source = "reflectance of at most 1";
    constexpr double kRounding = 1 - 1e-12;
    changes_.Scale("materials.material.lambert_ggx.diffuse_albedo", kRounding / largest, source);
    changes_.Scale("materials.material.lambert_ggx.specular_f0", kRounding / largest, source);
    changes_.Scale("laser.power_w", largest, source);
  }

 private:
  bool Contains(std::string_view component) const {
    return std::find(recorded_.begin(), recorded_.end(), component) != recorded_.end();
  }

  // True if this component of the inspection is that of the recordings; warns otherwise.
  bool IsRecorded(std::string_view component, const std::string& source) {
    if (Contains(component)) return true;
    const auto* const known =
        std::find_if(kComponents.begin(), kComponents.end(),
                     [&](const Component& one) { return one.name == component; });
    changes_.Warn(absl::StrCat(
        source, ": ",
        known == kComponents.end() ? absl::StrCat("no ", std::string(component)) : known->in_words,
        " of the inspection is that of the recordings: left as it is"));
    return false;
  }

  InspectionChanges changes_;
  v1::Inspection& inspection_;
  std::vector<std::string_view> recorded_;  // components that are those of the recordings
  std::vector<int> plate_materials_;        // those that state the plate's surface
};

}  // namespace

CalibratedInspection CalibrateInspection(const v1::Inspection& inspection,
                                         const v1::Recordings& nominal,
                                         const v1::Diagnosis& diagnosis) {
  CalibratedInspection result;
  result.inspection = inspection;
  Calibration calibration(nominal, &result);
  // Negligible deviations would only lengthen the list.
  for (const v1::FittedDeviation& deviation : diagnosis.model_fit().deviations()) {
    if (!std::isfinite(deviation.value()) ||
        std::abs(deviation.value()) <= kNegligible * deviation.standard_uncertainty()) {
      continue;
    }
    calibration.ApplyDeviation(deviation.name(), deviation.value());
  }
  for (const v1::Effect& effect : diagnosis.calibrated_effects()) {
    calibration.ApplyEffect(effect, ChangesOf(effect, diagnosis));
  }
  calibration.KeepReflectanceBelowOne();
  return result;
}

absl::StatusOr<CalibratedInspection> CalibrateInspectionFile(const std::string& path,
                                                             const v1::Recordings& nominal,
                                                             const v1::Diagnosis& diagnosis,
                                                             const std::string& out_folder) {
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(path, &message));
  const fs::path base = fs::absolute(path).lexically_normal().parent_path();
  SIGHTLINE_ASSIGN_OR_RETURN(v1::Inspection inlined,
                             InlineInspectionFiles(message, path, base.string()));
  SIGHTLINE_RETURN_IF_ERROR(ParseInspection(inlined, path, "").status());
  CalibratedInspection result = CalibrateInspection(inlined, nominal, diagnosis);
  SIGHTLINE_RETURN_IF_ERROR(
      ParseInspection(result.inspection, absl::StrCat(path, ", calibrated"), "").status());
  NameFilesFrom(out_folder, &result.inspection);
  return result;
}

}  // namespace sightline
