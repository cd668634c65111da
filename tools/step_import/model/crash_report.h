// SPDX-License-Identifier: Apache-2.0
// OpenCASCADE crashes on some damaged geometry. Such a crash says something about the file, so it
// ends this program as any other refusal of the file does: a message and an exit code.
#pragma once

#include <string>

namespace sightline {

// While an object of this class lives, SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT write
// "MESSAGE (signal N)" to stderr and end the process with `exit_code`. One object at a time.
class CrashReport {
 public:
  CrashReport(const std::string& message, int exit_code);
  ~CrashReport();
  CrashReport(const CrashReport&) = delete;
  CrashReport& operator=(const CrashReport&) = delete;
};

}  // namespace sightline
