// SPDX-License-Identifier: Apache-2.0
// The report of an acceptance test: simulated, predicted and permitted errors, and their causes.
#pragma once

#include "sightline/v1/acceptance.pb.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

// The same result gives the same report.
v1::Report AcceptanceReport(const v1::AcceptanceResult& result);

}  // namespace sightline
