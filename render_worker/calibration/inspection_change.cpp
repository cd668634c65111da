// SPDX-License-Identifier: Apache-2.0
#include "render_worker/calibration/inspection_change.h"

#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

namespace sightline {
namespace {

using Change = v1::InspectionChange;

// Spectrum of the light from all around in the diagnosis of parts.
constexpr char kSurroundings[] = "d65";
constexpr int kBounces = 4;  // default of an inspection

// Component that a field belongs to.
std::string ComponentOf(std::string_view field) {
  for (const char* component : {"camera.sensor", "lens", "laser", "materials"}) {
    if (field.starts_with(std::string(component) + ".")) return component;
  }
  return "";
}

// Component that an effect of this stage belongs to.
std::string ComponentOf(Stage stage) {
  switch (stage) {
    case Stage::kIllumination:
      return "laser";
    case Stage::kOptics:
      return "lens";
    case Stage::kSensor:
      return "camera.sensor";
    case Stage::kSurface:
    case Stage::kGeometry:
    case Stage::kTime:
      return "";
  }
  return "";
}

Change* AddChange(std::string_view source, v1::Diagnosis* diagnosis) {
  Change* change = diagnosis->add_inspection_changes();
  change->set_source(std::string(source));
  return change;
}

void AddField(const ActiveEffect& effect, const InspectionField& field, const RecordingSet& set,
              v1::Diagnosis* diagnosis) {
  const EffectDescription& description = effect.effect->description();
  const auto index = static_cast<size_t>(field.parameter);
  const EffectParameter& parameter = description.parameters[index];
  const double value = effect.parameters[index];
  if (field.field.empty()) {
    if (value == parameter.null_value) return;
    Change* change = AddChange(description.id, diagnosis);
    change->set_reason(Change::REASON_FLAT_PLATE);
    change->set_parameter(std::string(parameter.name));
    change->set_value(value);
    return;
  }
  Change* change = AddChange(description.id, diagnosis);
  change->set_component(ComponentOf(field.field));
  change->set_field(std::string(field.field));
  change->set_operation(field.operation == InspectionField::kFactor ? Change::OPERATION_FACTOR
                                                                    : Change::OPERATION_SHIFT);
  change->set_value(value);
  change->set_effect_instead(field.may_stay_an_effect);
  if (!field.is_radiance_of_plate) return;
  if (set.part) {
    change->mutable_spectrum()->set_illuminant(kSurroundings);
  } else {
    change->set_value(value / HemisphericalReflectance(set.surface));
    change->mutable_spectrum()->mutable_line()->set_wavelength_m(set.laser.wavelength_m);
  }
}

}  // namespace

void AddInspectionChanges(const ActiveEffect& effect, const RecordingSet& set,
                          v1::Diagnosis* diagnosis) {
  const EffectDescription& description = effect.effect->description();
  for (const InspectionField& field : description.inspection_fields) {
    AddField(effect, field, set, diagnosis);
  }
  if (!description.inspection_fields.empty()) return;
  Change* change = AddChange(description.id, diagnosis);
  change->set_component(ComponentOf(description.stage));
  switch (description.scope) {
    case EffectScope::kAnyImage:
      change->set_field("effects");
      break;
    case EffectScope::kFlatPlate:
      change->set_reason(Change::REASON_FLAT_PLATE);
      break;
    case EffectScope::kRecordingSetUp:
      change->set_reason(Change::REASON_RECORDING_SET_UP);
      break;
  }
}

void AddInterreflectionChanges(const std::string& source, bool laser_light, double factor,
                               v1::Diagnosis* diagnosis) {
  if (laser_light) {
    Change* on = AddChange(source, diagnosis);
    on->set_field("render.laser_interreflection");
    on->set_operation(Change::OPERATION_VALUE);
    on->set_value(1);
  }
  Change* bounces = AddChange(source, diagnosis);
  bounces->set_field("render.max_bounces");
  bounces->set_operation(Change::OPERATION_INSTEAD_OF_ZERO);
  bounces->set_value(kBounces);
  Change* left_out = AddChange(source, diagnosis);
  left_out->set_reason(Change::REASON_STATED_MATERIALS);
  left_out->set_value(factor);
}

void AddWithoutField(const std::string& source, v1::Diagnosis* diagnosis) {
  AddChange(source, diagnosis)->set_reason(Change::REASON_NO_FIELD);
}

double HemisphericalReflectance(const RecordedSurface& surface) {
  constexpr int kSteps = 2000;
  const double alpha2 = surface.ggx_alpha * surface.ggx_alpha;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double theta = (i + 0.5) / kSteps * std::numbers::pi / 2;
    const double ch = std::cos(theta / 2), tangent = std::tan(theta);
    const double d = alpha2 / (std::numbers::pi * std::pow(ch * ch * (alpha2 - 1) + 1, 2));
    const double f = surface.specular_f0 + (1 - surface.specular_f0) * std::pow(1 - ch, 5);
    const double g = 2 / (1 + std::sqrt(1 + alpha2 * tangent * tangent));
    sum += d * f * g / 4 * std::sin(theta);
  }
  return surface.diffuse_albedo + std::numbers::pi * std::numbers::pi / kSteps * sum;
}

}  // namespace sightline
