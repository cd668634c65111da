// SPDX-License-Identifier: Apache-2.0
// The message of a program that has no memory left.
#pragma once

namespace sightline {

// From now on an exception of type std::bad_alloc that nobody catches, in whatever thread, ends the
// process with exit code 1 and "PROGRAM: out of memory" on stderr instead of SIGABRT. For the start
// of main.
void ReportOutOfMemory(const char* program);

}  // namespace sightline
