// Ctrl-C: the first asks the running command to stop and keep what it has, the second ends it.
#pragma once

#include <atomic>

namespace sightline {

// Set once SIGINT or SIGTERM arrives. The first call installs the handlers.
const std::atomic<bool>& InterruptFlag();

}  // namespace sightline
