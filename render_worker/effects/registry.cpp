#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "render_worker/effects/effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

// In the order of the recordings format; effects that wrap each other's functions of the plate give
// the intended composition in this order (profile of the beam first, then its place on the plate).
const std::vector<const Effect*>& Registry() {
  static const std::vector<const Effect*> effects = {&AmbientLight(),
                                                     &PowerError(),
                                                     &PowerDrift(),
                                                     &PowerNoise(),
                                                     &BeamQuality(),
                                                     &BeamFocus(),
                                                     &BeamShape(),
                                                     &LineNonuniformity(),
                                                     &LineBow(),
                                                     &GhostLine(),
                                                     &PartialCoherence(),
                                                     &WavelengthError(),
                                                     &AlbedoError(),
                                                     &BrdfError(),
                                                     &SubsurfaceScattering(),
                                                     &Depolarisation(),
                                                     &AlbedoTexture(),
                                                     &TiltedPlate(),
                                                     &CurvedPlate(),
                                                     &Fluorescence(),
                                                     &FNumberError(),
                                                     &TransmissionError(),
                                                     &FocusError(),
                                                     &SphericalAberration(),
                                                     &Coma(),
                                                     &Astigmatism(),
                                                     &FieldCurvature(),
                                                     &VeilingGlare(),
                                                     &LensReflection(),
                                                     &RadialDistortion(),
                                                     &TangentialDistortion(),
                                                     &MechanicalVignetting(),
                                                     &NaturalVignetting(),
                                                     &PolygonAperture(),
                                                     &CoverGlassEtalon(),
                                                     &Dust(),
                                                     &CameraDistanceError(),
                                                     &LaserDistanceError(),
                                                     &IncidenceAngleError(),
                                                     &CameraRoll(),
                                                     &LaserRoll(),
                                                     &SensorTilt(),
                                                     &ResponseNonlinearity(),
                                                     &DarkCurrent(),
                                                     &BlackLevelError(),
                                                     &Prnu(),
                                                     &DsnuColumnPattern(),
                                                     &HotPixels(),
                                                     &Crosstalk(),
                                                     &BrighterFatter(),
                                                     &Blooming(),
                                                     &Smear(),
                                                     &LowerFullWell(),
                                                     &GainError(),
                                                     &QeError(),
                                                     &ColourResponseError(),
                                                     &ReadNoiseExcess(),
                                                     &RowNoise(),
                                                     &AdcMissingBits(),
                                                     &AdcInl(),
                                                     &ImageLag(),
                                                     &RollingShutter(),
                                                     &VibrationBlur(),
                                                     &PlateMotion(),
                                                     &ExposureOffset(),
                                                     &ExposureJitter(),
                                                     &AmbientFlicker(),
                                                     &TemperatureDrift()};
  return effects;
}

// Edit distance of Levenshtein.
size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

// At most so much of a name from outside is looked at and repeated.
std::string_view Head(std::string_view name) { return name.substr(0, 100); }

std::string Nearest(std::string_view name, const std::vector<std::string_view>& known) {
  std::string_view best;
  size_t least = std::numeric_limits<size_t>::max();
  for (const std::string_view candidate : known) {
    const size_t distance = EditDistance(Head(name), candidate);
    if (distance < least) {
      least = distance;
      best = candidate;
    }
  }
  return std::string(best);
}

}  // namespace

std::span<const Effect* const> AllEffects() { return Registry(); }

const Effect* FindEffect(std::string_view id) {
  for (const Effect* effect : Registry()) {
    if (effect->description().id == id) return effect;
  }
  return nullptr;
}

absl::StatusOr<ActiveEffect> MakeActiveEffect(std::string_view id,
                                              const std::vector<NamedValue>& parameters) {
  const Effect* effect = FindEffect(id);
  if (effect == nullptr) {
    std::vector<std::string_view> ids;
    for (const Effect* known : Registry()) ids.push_back(known->description().id);
    return absl::InvalidArgumentError(absl::StrCat("there is no effect \"", std::string(Head(id)),
                                                   "\"; the nearest known name is \"",
                                                   Nearest(id, ids), "\""));
  }
  const EffectDescription& description = effect->description();
  ActiveEffect active{effect, {}};
  std::vector<std::string_view> names;
  for (const EffectParameter& parameter : description.parameters) {
    active.parameters.push_back(parameter.null_value);
    names.push_back(parameter.name);
  }
  std::vector<bool> given(names.size(), false);
  for (const NamedValue& value : parameters) {
    const auto found = std::find(names.begin(), names.end(), value.name);
    if (found == names.end()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "effect ", std::string(id), " has no parameter \"", std::string(Head(value.name)),
          "\"; the nearest known name is \"", Nearest(value.name, names), "\""));
    }
    const size_t index = static_cast<size_t>(found - names.begin());
    const EffectParameter& parameter = description.parameters[index];
    if (given[index]) {
      return absl::InvalidArgumentError(
          absl::StrCat("effect ", std::string(id), ": parameter ", value.name, " is given twice"));
    }
    given[index] = true;
    if (!(value.value >= parameter.lower && value.value <= parameter.upper)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "effect ", std::string(id), ": ", value.name, " is ", NumberText(value.value),
          ", must be in [", NumberText(parameter.lower), ", ", NumberText(parameter.upper), "]"));
    }
    active.parameters[index] = value.value;
  }
  return active;
}

absl::Status OrderEffects(std::vector<ActiveEffect>* effects) {
  std::vector<ActiveEffect> ordered;
  for (const Effect* effect : AllEffects()) {
    const size_t before = ordered.size();
    for (ActiveEffect& active : *effects) {
      if (active.effect == effect) ordered.push_back(std::move(active));
    }
    if (ordered.size() > before + 1) {
      return absl::InvalidArgumentError(
          absl::StrCat("effect ", std::string(effect->description().id), " is given twice"));
    }
  }
  *effects = std::move(ordered);
  return absl::OkStatus();
}

}  // namespace sightline
