// SPDX-License-Identifier: Apache-2.0
// Memory of a process and all that descend from it.
#pragma once

#include <sys/types.h>

#include <cstdint>

namespace sightline {

// Bytes of physical memory of the process and its descendants, shared pages divided among those who
// share them (proportional set size of /proc/PID/smaps_rollup), resident pages if the kernel does
// not give these. 0: the process is gone.
int64_t ProcessTreeMemory(pid_t pid);

}  // namespace sightline
