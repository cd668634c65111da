// SPDX-License-Identifier: Apache-2.0
// States how fitted effects are carried into an inspection. A client applies the changes by their
// field paths and needs to know no effect.
#pragma once

#include <string>

#include "core/recordings/recordings.h"
#include "render_worker/effects/effect.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Adds the changes of an effect of the vocabulary, one or more, as its description states them
// (EffectDescription::inspection_fields, else its scope). `set`: the recordings it was fitted to.
//
// A radiance L of the plate becomes that of the light which falls on it evenly from everywhere:
// L/rho with rho the reflectance of the plate for such light seen along its normal, at the laser's
// wavelength. On recordings of a part, L is the radiance of that light already, with the spectrum
// d65 that the diagnosis assumes.
void AddInspectionChanges(const ActiveEffect& effect, const RecordingSet& set,
                          v1::Diagnosis* diagnosis);

// Adds the changes that switch light between surfaces on: of lamps always, of the laser if
// `laser_light`. `factor`: fitted light over what the stated materials lead to expect.
void AddInterreflectionChanges(const std::string& source, bool laser_light, double factor,
                               v1::Diagnosis* diagnosis);

// Adds that no field of an inspection says the same as `source`.
void AddWithoutField(const std::string& source, v1::Diagnosis* diagnosis);

// Reflectance of the plate for even light from everywhere, seen along its normal: the integral of
// f_r cos(theta) over the half space (recordings format, section 3; Helmholtz reciprocity), by 2000
// midpoints in theta.
double HemisphericalReflectance(const RecordedSurface& surface);

}  // namespace sightline
