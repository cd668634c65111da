// SPDX-License-Identifier: Apache-2.0
// What an exception means to whoever asked for the work.
#pragma once

#include "absl/status/status.h"

namespace sightline {

// Of the exception being handled: call it in a catch block only. RESOURCE_EXHAUSTED where memory or
// threads ran out, INTERNAL for all others.
absl::Status StatusOfException();

}  // namespace sightline
