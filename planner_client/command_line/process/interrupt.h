// SPDX-License-Identifier: Apache-2.0
// Ctrl-C: the first asks the running command to stop, and says so on stderr; the second ends it.
// Only the command knows whether anything is kept, and says so when it ends.
#pragma once

#include <atomic>

namespace sightline {

// Set once SIGINT or SIGTERM arrives. The first call installs the handlers: commands make it when
// they have something to keep, since loading parts and hulls cannot be stopped otherwise.
const std::atomic<bool>& InterruptFlag();

}  // namespace sightline
