// SPDX-License-Identifier: Apache-2.0
// Numbers of the report's pictures: profiles across the line, maps of residuals.
#pragma once

#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Laser recordings in which the two fits differ most in chi squared, most telling first.
std::vector<int> TellingRecordings(const SetModel& model, const FitResult& null,
                                   const FitResult& best, int count);

// Mean over the columns of every row, observed and by both fits. Colour sensors: the channel that
// tells most.
v1::ProfileComparison CompareProfiles(const SetModel& model, const FitResult& null,
                                      const FitResult& best, int recording);

// Standardised residuals of the profile's bins, in blocks along the line.
v1::RegionMap MapRegions(const SetModel& model, const FitResult& null, const FitResult& best,
                         int recording);

}  // namespace sightline
