// SPDX-License-Identifier: Apache-2.0
#include "core/process/out_of_memory.h"

#include <unistd.h>

#include <cstring>
#include <exception>
#include <new>

namespace sightline {
namespace {

const char* program_name = "";
std::terminate_handler previous_handler = nullptr;

void Write(const char* text) {
  if (write(STDERR_FILENO, text, std::strlen(text)) < 0) _exit(1);
}

void EndProcess() {
  if (const std::exception_ptr current = std::current_exception()) {
    try {
      std::rethrow_exception(current);
    } catch (const std::bad_alloc&) {
      // Nothing here needs memory.
      Write(program_name);
      Write(": out of memory\n");
      _exit(1);
    } catch (...) {
    }
  }
  previous_handler();
}

}  // namespace

void ReportOutOfMemory(const char* program) {
  program_name = program;
  previous_handler = std::set_terminate(EndProcess);
}

}  // namespace sightline
