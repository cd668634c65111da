// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/answer/calibrated_scene.h"

#include <algorithm>
#include <cstddef>
#include <string>

#include "render_worker/calibration/inspection_change.h"
#include "render_worker/effects/effect.h"
#include "render_worker/scene_diagnosis/light/path_names.h"

namespace sightline {
namespace {

void ScaleLamps(double factor, v1::Lighting* lighting) {
  if (lighting->has_ambient()) {
    lighting->mutable_ambient()->set_radiance_w_m2_sr(factor *
                                                      lighting->ambient().radiance_w_m2_sr());
  }
  for (v1::AreaLight& light : *lighting->mutable_area_lights()) {
    light.set_radiance_w_m2_sr(factor * light.radiance_w_m2_sr());
  }
}

// Applies the factor of a path of the null model.
void ApplyFactor(const LightPath& path, double factor, RecordingSet* set) {
  if (path.effect == kLaserFactor) {
    set->laser.power_w *= factor;
    if (set->part) set->part->laser.power_w *= factor;
  } else if (path.effect == kDarkMeanElectrons) {
    set->camera.dark_mean_electrons = std::max(0.0, set->camera.dark_mean_electrons + factor);
  } else if (path.effect == kLampFactor && set->part) {
    ScaleLamps(factor, &set->part->lighting);
  }
}

// Adds the light path as an effect, and how an inspection expresses it.
void AddCalibratedEffect(const LightPath& path, double factor, const RecordingSet& set,
                         v1::Diagnosis* diagnosis) {
  v1::Effect* effect = diagnosis->add_calibrated_effects();
  effect->set_effect(path.effect);
  auto& parameters = *effect->mutable_parameters();
  parameters[path.parameter] = factor;
  if (!path.shape_name.empty()) parameters[path.shape_name] = path.shape;
  const Effect* known = FindEffect(path.effect);
  if (known == nullptr) {
    if (path.effect == kInterreflection || path.effect == kLampInterreflection) {
      AddInterreflectionChanges(path.effect, path.laser_light, factor, diagnosis);
    } else {
      AddWithoutField(path.effect, diagnosis);
    }
    return;
  }
  ActiveEffect active{known, {}};
  for (const EffectParameter& p : known->description().parameters) {
    active.parameters.push_back(p.null_value);
    const auto found = parameters.find(std::string(p.name));
    if (found == parameters.end()) continue;
    found->second = std::clamp(found->second, p.lower, p.upper);
    active.parameters.back() = found->second;
  }
  AddInspectionChanges(active, set, diagnosis);
}

}  // namespace

void AddCalibration(const RecordedScene& scene, const PathFit& fit, v1::Diagnosis* diagnosis) {
  RecordingSet set = scene.recordings;
  for (size_t k = 0; k < fit.paths.size(); ++k) {
    const LightPath& path = *fit.paths[k];
    const double factor = fit.factors[static_cast<Eigen::Index>(k)];
    if (path.nominal) {
      ApplyFactor(path, factor, &set);
    } else if (path.effect != kUnknownLight) {
      AddCalibratedEffect(path, factor, set, diagnosis);
    }
  }
  *diagnosis->mutable_calibrated() = RecordingsToProto(set);
}

}  // namespace sightline
