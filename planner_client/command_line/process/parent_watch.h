// SPDX-License-Identifier: Apache-2.0
// Ends this process together with its parent process.
#pragma once

#include "absl/status/status.h"

namespace sightline {

// `read_end`: descriptor of a pipe whose other end only the parent holds. When that end closes,
// for any reason, this process and its own servers end at once. INVALID_ARGUMENT: no open
// descriptor.
absl::Status EndWithParent(int read_end);

}  // namespace sightline
