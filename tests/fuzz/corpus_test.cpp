// Every seed of the fuzzers, also those they found, within limits of time and memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "tests/fuzz/fuzz_targets.h"
#include "tests/limits/within_limits.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

fs::path CorpusFolder() {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  return fs::path(source != nullptr ? source : ".") / "tests/fuzz/corpus";
}

std::string Bytes(const fs::path& path) {
  std::ostringstream bytes;
  bytes << std::ifstream(path, std::ios::binary).rdbuf();
  return bytes.str();
}

class CorpusTest : public ::testing::TestWithParam<std::string> {};

TEST_P(CorpusTest, EverySeedIsReadSoonAndWithLittleMemory) {
  const fs::path folder = CorpusFolder() / GetParam();
  ASSERT_TRUE(fs::is_directory(folder)) << folder << ": every target has seeds";
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string bytes = Bytes(entry.path());
    EXPECT_EQ(WithinLimits({.cpu_time_s = 5, .memory_bytes = int64_t{1} << 30},
                           [&] {
                             FuzzTargets().at(GetParam())(bytes);
                             return std::string("ended");
                           }),
              "ended")
        << entry.path();
  }
}

std::vector<std::string> Names() {
  std::vector<std::string> names;
  for (const auto& [name, target] : FuzzTargets()) names.push_back(name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Targets, CorpusTest, ::testing::ValuesIn(Names()),
                         [](const auto& instance) { return instance.param; });

}  // namespace
}  // namespace sightline
