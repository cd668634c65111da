// SPDX-License-Identifier: Apache-2.0
// The nominal description with what was found.
#pragma once

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

// Fitted deviations become nominal values, their standard errors the uncertainties. Line shifts of
// single plate positions stay out: another mounting has others.
RecordingSet CalibratedSet(const RecordingSet& nominal, const FitResult& fit);

}  // namespace sightline
