// SPDX-License-Identifier: Apache-2.0
// Memory of a process and all its descendants.
#pragma once

#include <sys/types.h>

#include <cstdint>

namespace sightline {

// Physical memory [bytes] of the process and its descendants: the proportional set size of
// /proc/PID/smaps_rollup, which divides shared pages among the processes that share them, or the
// resident set size if the kernel does not give that. 0: the process is gone.
int64_t ProcessTreeMemory(pid_t pid);

}  // namespace sightline
