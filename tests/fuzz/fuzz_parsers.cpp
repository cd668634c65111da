// SPDX-License-Identifier: Apache-2.0
// libFuzzer on one reader: fuzz_parsers --target=NAME CORPUS_FOLDER [options of libFuzzer].
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "tests/fuzz/fuzz_targets.h"

namespace {

const sightline::FuzzTarget* target = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  constexpr std::string_view kOption = "--target=";
  for (int i = 1; i < *argc; ++i) {
    const std::string_view argument = (*argv)[i];
    if (argument.substr(0, kOption.size()) != kOption) continue;
    const auto found = sightline::FuzzTargets().find(std::string(argument.substr(kOption.size())));
    if (found != sightline::FuzzTargets().end()) target = &found->second;
  }
  if (target != nullptr) return 0;
  std::fprintf(stderr, "give --target=NAME, one of:");
  for (const auto& [name, function] : sightline::FuzzTargets()) {
    std::fprintf(stderr, " %s", name.c_str());
  }
  std::fprintf(stderr, "\n");
  std::exit(2);
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  (*target)({reinterpret_cast<const char*>(data), size});
  return 0;
}
