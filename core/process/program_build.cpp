// SPDX-License-Identifier: Apache-2.0
#include "core/process/program_build.h"

#include "core/digest/sha256.h"

namespace sightline {

const std::string& ProgramBuild() {
  static const std::string build = [] {
    const auto digest = DigestOfFile("/proc/self/exe");
    return digest.ok() ? digest->sha256 : std::string("unknown");
  }();
  return build;
}

}  // namespace sightline
