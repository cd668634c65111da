// SPDX-License-Identifier: Apache-2.0
// Departures in the answer, corrected for the number of tests, detected ones first; verdict and
// finding.
#pragma once

#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// A departure counts as detected if it is testable and material and if its p-value times the number
// of tests (Bonferroni) is below 0.001. Its probability follows from its own p-value by the bound
// of render_worker/evidence/significance.h, with equal prior shares of 1 - kPriorOfNoEffect. The
// order is otherwise that of `departures`: photon transfer, fixed patterns, frames, converter.
void AddDepartures(const std::vector<Departure>& departures, v1::SensorDiagnosis* answer);

}  // namespace sightline
