// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/inspection_number.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Defaults and ranges are those with which an inspection is read (core/inspection), a little above
// zero where zero is excluded.
constexpr double kAboveZero = 1e-12;
constexpr std::array kRanges = {
    NumberRange{"camera.sensor.dark_current_electrons_per_s", 0, 0, 1e9},
    NumberRange{"camera.sensor.dark_mean_electrons", 0, 0, 1e9},
    NumberRange{"camera.sensor.dark_noise_electrons", 0, 0, 1e9},
    NumberRange{"camera.sensor.gain_dn_per_electron", 1, kAboveZero, 1e6},
    NumberRange{"camera.sensor.quantum_efficiency.mono", {}, 0, 1},
    NumberRange{"camera.sensor.quantum_efficiency.red", {}, 0, 1},
    NumberRange{"camera.sensor.quantum_efficiency.green", {}, 0, 1},
    NumberRange{"camera.sensor.quantum_efficiency.blue", {}, 0, 1},
    NumberRange{"camera.sensor.quantum_efficiency_curve.mono", {}, 0, 1},
    NumberRange{"camera.sensor.quantum_efficiency_curve.red", {}, 0, 1},
    NumberRange{"camera.sensor.quantum_efficiency_curve.green", {}, 0, 1},
    NumberRange{"camera.sensor.quantum_efficiency_curve.blue", {}, 0, 1},
    NumberRange{"laser.beam_focus_distance_m", 0.9, 0, 100},
    NumberRange{"laser.beam_quality_m2", 1, 1, 1000},
    NumberRange{"laser.divergence_rad", 0.24e-3, kAboveZero, 0.5},
    NumberRange{"laser.power_w", 0.023, 0, 100},
    NumberRange{"laser.wavelength_m", 661e-9, 200e-9, 2000e-9},
    NumberRange{"lens.f_number", 8, 0.5, 128},
    NumberRange{"lens.focus_distance_m", {}, 1e-3, 1000, "the lens is focused on the rig's origin"},
    NumberRange{"lens.transmission", 1, kAboveZero, 1},
    NumberRange{"lighting.ambient.radiance_w_m2_sr", 0, 0, 1e6},
    NumberRange{"lighting.area_lights.radiance_w_m2_sr", 0, 0, 1e6},
    NumberRange{"materials.material.lambert_ggx.diffuse_albedo", 0, 0, 1},
    NumberRange{"materials.material.lambert_ggx.specular_f0", 0, 0, 1},
    NumberRange{"materials.material.lambert_ggx.ggx_alpha", 1, 1e-3, 1},
    NumberRange{"render.laser_interreflection", 0, 0, 1},
    NumberRange{"render.max_bounces", {}, 0, 32},
};

// Numbers below `message` at the rest of the path of `range`, of which `before` is the text.
void Collect(const NumberRange& range, std::string_view rest, const std::string& before,
             const std::vector<int>& material_indices, Message* message,
             std::vector<InspectionNumber>* numbers) {
  const size_t dot = rest.find('.');
  const std::string name(rest.substr(0, dot));
  const FieldDescriptor* field = message->GetDescriptor()->FindFieldByName(name);
  if (field == nullptr) return;
  if (dot == std::string_view::npos) {
    numbers->push_back({message, field, &range, before + name});
    return;
  }
  rest.remove_prefix(dot + 1);
  const auto* reflection = message->GetReflection();
  if (!field->is_repeated()) {
    if (!range.unset && !reflection->HasField(*message, field)) return;
    Collect(range, rest, absl::StrCat(before, name, "."), material_indices,
            reflection->MutableMessage(message, field), numbers);
    return;
  }
  for (int i = 0; i < reflection->FieldSize(*message, field); ++i) {
    if (name == "materials" &&
        std::find(material_indices.begin(), material_indices.end(), i) == material_indices.end()) {
      continue;
    }
    Collect(range, rest, absl::StrCat(before, name, "[", i, "]."), material_indices,
            reflection->MutableRepeatedMessage(message, field, i), numbers);
  }
}

}  // namespace

const NumberRange* FindNumberRange(std::string_view path) {
  const auto* const found = std::find_if(kRanges.begin(), kRanges.end(),
                                         [&](const auto& range) { return range.path == path; });
  return found == kRanges.end() ? nullptr : found;
}

bool InspectionNumber::IsStated() const {
  return message->GetReflection()->HasField(*message, field);
}

double InspectionNumber::Get() const {
  if (!IsStated()) return range->unset.value_or(0);
  const auto* reflection = message->GetReflection();
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_BOOL:
      return reflection->GetBool(*message, field) ? 1 : 0;
    case FieldDescriptor::CPPTYPE_INT32:
      return reflection->GetInt32(*message, field);
    default:
      return reflection->GetDouble(*message, field);
  }
}

void InspectionNumber::Set(double value) const {
  const auto* reflection = message->GetReflection();
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_BOOL:
      reflection->SetBool(message, field, value != 0);
      break;
    case FieldDescriptor::CPPTYPE_INT32:
      reflection->SetInt32(message, field, static_cast<int32_t>(value));
      break;
    default:
      reflection->SetDouble(message, field, value);
  }
}

std::vector<InspectionNumber> NumbersAt(const NumberRange& range,
                                        const std::vector<int>& material_indices,
                                        v1::Inspection* inspection) {
  std::vector<InspectionNumber> numbers;
  Collect(range, range.path, "", material_indices, inspection, &numbers);
  return numbers;
}

}  // namespace sightline
