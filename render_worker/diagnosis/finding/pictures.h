// SPDX-License-Identifier: Apache-2.0
// Data of the report's pictures: profiles across the line, maps of residuals.
#pragma once

#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Laser recordings in which the chi squared of both fits differs most, largest difference first.
std::vector<int> TellingRecordings(const SetModel& model, const FitResult& null,
                                   const FitResult& best, int count);

// Mean of every row over the columns, observed and by both fits. For colour sensors, the most
// informative channel.
v1::ProfileComparison CompareProfiles(const SetModel& model, const FitResult& null,
                                      const FitResult& best, int recording);

// Standardised residuals of the profile's bins, in blocks along the line.
v1::RegionMap MapRegions(const SetModel& model, const FitResult& null, const FitResult& best,
                         int recording);

}  // namespace sightline
