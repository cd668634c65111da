// SPDX-License-Identifier: Apache-2.0
// Every seed of the fuzzers, also those they found, within limits of time and memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
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

// Changes bytes, repeats, removes and exchanges pieces: what a fuzzer without sight would try.
std::string Mutated(const std::string& bytes, const std::string& other, std::mt19937& random) {
  std::string mutated = bytes;
  const auto place = [&](size_t size) { return size == 0 ? 0 : random() % size; };
  for (int change = static_cast<int>(random() % 4); change >= 0; --change) {
    const size_t at = place(mutated.size());
    const size_t length = 1 + random() % 16;
    switch (random() % 6) {
      case 0:
        if (!mutated.empty()) mutated[at] = static_cast<char>(random());
        break;
      case 1:
        mutated.erase(at, length);
        break;
      case 2:
        mutated.insert(at, mutated.substr(at, length));
        break;
      case 3:
        mutated.insert(at, other.substr(place(other.size()), 4 * length));
        break;
      case 4:
        mutated.resize(at);
        break;
      default:
        // Numbers at the edge of their types.
        mutated.replace(at, std::min<size_t>(4, mutated.size() - at),
                        random() % 2 == 0 ? std::string(4, '\xff') : "1e39");
    }
  }
  return mutated;
}

TEST_P(CorpusTest, ChangedSeedsAreReadSoonAndWithLittleMemory) {
  std::vector<std::string> seeds;
  for (const auto& entry : fs::directory_iterator(CorpusFolder() / GetParam())) {
    seeds.push_back(Bytes(entry.path()));
  }
  std::sort(seeds.begin(), seeds.end());
  // More by hand: SIGHTLINE_FUZZ_RUNS=100000 SIGHTLINE_FUZZ_SEED=2.
  const auto number = [](const char* name, int otherwise) {
    const char* given = std::getenv(name);
    return given != nullptr ? std::atoi(given) : otherwise;
  };
  const int runs = number("SIGHTLINE_FUZZ_RUNS", 300);
  std::mt19937 random(static_cast<unsigned>(number("SIGHTLINE_FUZZ_SEED", 1)));
  constexpr int kBatch = 50;
  for (int first = 0; first < runs; first += kBatch) {
    std::vector<std::string> batch;
    for (int i = first; i < std::min(runs, first + kBatch); ++i) {
      batch.push_back(
          Mutated(seeds[random() % seeds.size()], seeds[random() % seeds.size()], random));
    }
    const WorkLimits limits = {.cpu_time_s = 10, .memory_bytes = int64_t{1} << 30};
    const auto read = [&](const std::string& bytes) {
      FuzzTargets().at(GetParam())(bytes);
      return std::string("ended");
    };
    const std::string said = WithinLimits(limits, [&] {
      for (const std::string& bytes : batch) read(bytes);
      return std::string("ended");
    });
    if (said == "ended") continue;
    for (const std::string& bytes : batch) {
      const std::string alone = WithinLimits(limits, [&] { return read(bytes); });
      if (alone == "ended") continue;
      const std::string file = ::testing::TempDir() + "/changed_seed_" + GetParam();
      std::ofstream(file, std::ios::binary) << bytes;
      FAIL() << alone << ": " << file;
    }
    FAIL() << said << ", in a batch";
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
