// SPDX-License-Identifier: Apache-2.0
// Turns an exception into a status for the caller.
#pragma once

#include "absl/status/status.h"

namespace sightline {

// Status for the exception that is being handled; to be called only in a catch block.
// RESOURCE_EXHAUSTED if memory or threads ran out, INTERNAL for all other exceptions.
absl::Status StatusOfException();

}  // namespace sightline
