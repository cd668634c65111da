// SPDX-License-Identifier: Apache-2.0
// Turns an exception into a status for the caller.
#pragma once

#include "absl/status/status.h"

namespace sightline {

// Status for the exception that is being handled: call it in a catch block only. RESOURCE_EXHAUSTED
// where memory or threads ran out, INTERNAL for all others.
absl::Status StatusOfException();

}  // namespace sightline
