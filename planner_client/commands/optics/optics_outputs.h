// SPDX-License-Identifier: Apache-2.0
// Output files of an optical plan, in addition to its report.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "sightline/v1/optics.pb.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Writes optics.json without the pictures, which belong to the report. The file appears complete or
// not at all.
absl::Status WriteOpticsJson(const v1::OpticsPlan& optics, const std::string& path);

// Gives every scan of the plan its own setting, or the common one if it has none of its own.
void SetSettings(const v1::OpticsPlan& optics, v1::Plan* plan);

}  // namespace sightline
