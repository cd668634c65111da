// SPDX-License-Identifier: Apache-2.0
// The message of a program that has no memory left.
#pragma once

namespace sightline {

// After this call an uncaught std::bad_alloc in any thread ends the process with exit code 1 and
// "PROGRAM: out of memory" on stderr instead of SIGABRT. To be called at the start
// of main.
void ReportOutOfMemory(const char* program);

}  // namespace sightline
