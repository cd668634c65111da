// SPDX-License-Identifier: Apache-2.0
// The nominal description with the fitted values.
#pragma once

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

// Fitted deviations become nominal values, and their standard errors the uncertainties. Line shifts
// of single plate positions are left out, since they differ after another mounting.
RecordingSet CalibratedSet(const RecordingSet& nominal, const FitResult& fit);

}  // namespace sightline
