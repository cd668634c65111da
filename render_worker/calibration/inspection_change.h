// SPDX-License-Identifier: Apache-2.0
// States how an inspection expresses fitted effects. A client applies the changes by their field
// paths and needs no knowledge of single effects.
#pragma once

#include <string>

#include "core/recordings/recordings.h"
#include "render_worker/effects/effect.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Adds one or more changes for an effect of the vocabulary, as its description defines them
// (EffectDescription::inspection_fields, else its scope). `set`: recordings that it was fitted to.
//
// For recordings of a plate, a radiance L of the plate becomes the radiance of isotropic incident
// light, L/rho. rho is the reflectance of the plate for such light seen along its normal, at the
// laser's wavelength. For recordings of a part, L is already the radiance of that light, with the
// spectrum d65 that the diagnosis assumes.
void AddInspectionChanges(const ActiveEffect& effect, const RecordingSet& set,
                          v1::Diagnosis* diagnosis);

// Adds the changes that switch interreflection on: always for lamps, for the laser if
// `laser_light`. `factor`: fitted light over the light that the stated materials predict.
void AddInterreflectionChanges(const std::string& source, bool laser_light, double factor,
                               v1::Diagnosis* diagnosis);

// Adds a note that no field of an inspection expresses `source`.
void AddWithoutField(const std::string& source, v1::Diagnosis* diagnosis);

// Reflectance of the plate for isotropic incident light, seen along its normal: the integral of f_r
// cos(theta) over the half space (recordings format, section 3; Helmholtz reciprocity), by the
// midpoint rule with 2000 points in theta.
double HemisphericalReflectance(const RecordedSurface& surface);

}  // namespace sightline
