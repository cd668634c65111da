// SPDX-License-Identifier: Apache-2.0
// Ctrl-C: the first asks the running command to stop and prints that on stderr; the second ends it.
// Only the command knows which results it keeps, so it reports them when it ends.
#pragma once

#include <atomic>

namespace sightline {

// True once SIGINT or SIGTERM has arrived. The first call installs the handlers, so commands
// call it once they have results to keep; before, Ctrl-C must end the loading of parts and
// hulls.
const std::atomic<bool>& InterruptFlag();

}  // namespace sightline
