// SPDX-License-Identifier: Apache-2.0
// Files of an optical plan, besides its report.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "sightline/v1/optics.pb.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// optics.json, without the pictures, which belong to the report. The file appears at once or not at
// all.
absl::Status WriteOpticsJson(const v1::OpticsPlan& optics, const std::string& path);

// Gives every scan of the plan its own setting, or the common one if it has none of its own.
void SetSettings(const v1::OpticsPlan& optics, v1::Plan* plan);

}  // namespace sightline
