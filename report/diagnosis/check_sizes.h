// SPDX-License-Identifier: Apache-2.0
// Checks that the sizes of a diagnosis's fields agree.
#pragma once

#include "absl/status/status.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// INVALID_ARGUMENT names the first field whose size does not fit its neighbours', e.g. a profile
// with fewer values than rows, or edges of a map that do not ascend.
absl::Status CheckSizes(const v1::Diagnosis& diagnosis);

}  // namespace sightline
