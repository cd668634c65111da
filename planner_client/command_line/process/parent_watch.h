// SPDX-License-Identifier: Apache-2.0
// Ends this process with the one that started it.
#pragma once

#include "absl/status/status.h"

namespace sightline {

// `read_end`: descriptor of a pipe whose other end the parent holds. When that is closed, however
// the parent ended, this process ends at once; its own servers end with it. INVALID_ARGUMENT: no
// open descriptor.
absl::Status EndWithParent(int read_end);

}  // namespace sightline
