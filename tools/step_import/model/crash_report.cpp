// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/model/crash_report.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>

namespace sightline {
namespace {

constexpr std::array<int, 5> kCrashSignals = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};

// The handler reads these. It may call only functions that are safe in a signal handler
// (signal-safety(7)).
std::array<char, 4096> crash_message;
size_t crash_message_bytes = 0;
int crash_exit_code = 1;
// The handler needs a stack of its own: a crash may be a stack that is used up.
std::array<char, 65536> crash_stack;

void WriteAll(const char* text, size_t bytes) {
  while (bytes > 0) {
    const ssize_t written = write(STDERR_FILENO, text, bytes);
    if (written <= 0) return;
    text += written;
    bytes -= static_cast<size_t>(written);
  }
}

void HandleCrash(int number) {
  WriteAll(crash_message.data(), crash_message_bytes);
  const std::array<char, 11> end = {' ',
                                    '(',
                                    's',
                                    'i',
                                    'g',
                                    'n',
                                    'a',
                                    'l',
                                    ' ',
                                    static_cast<char>('0' + number / 10 % 10),
                                    static_cast<char>('0' + number % 10)};
  WriteAll(end.data(), end.size());
  WriteAll(")\n", 2);
  _exit(crash_exit_code);
}

}  // namespace

CrashReport::CrashReport(const std::string& message, int exit_code) {
  crash_message_bytes = std::min(message.size(), crash_message.size());
  std::copy_n(message.begin(), crash_message_bytes, crash_message.begin());
  crash_exit_code = exit_code;
  stack_t stack = {};
  stack.ss_sp = crash_stack.data();
  stack.ss_size = crash_stack.size();
  sigaltstack(&stack, nullptr);
  struct sigaction action = {};
  action.sa_handler = HandleCrash;
  action.sa_flags = SA_ONSTACK;
  sigemptyset(&action.sa_mask);
  for (const int number : kCrashSignals) sigaction(number, &action, nullptr);
}

CrashReport::~CrashReport() {
  for (const int number : kCrashSignals) signal(number, SIG_DFL);
}

}  // namespace sightline
