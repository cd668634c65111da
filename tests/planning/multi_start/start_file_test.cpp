// SPDX-License-Identifier: Apache-2.0
// Results of searches pass through files without losing a bit, or not at all.
#include "planning/multi_start/start_file.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>

#include "core/random/random.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

class StartFileTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_NE(mkdtemp(folder_.data()), nullptr); }
  void TearDown() override { fs::remove_all(folder_); }

  // Makes a result of numbers that no shorter text gives.
  static StartResult Sample() {
    Random random(11);
    StartResult start;
    start.seed = -7;
    start.stop_reason = StopReason::kMaxScans;
    start.evaluations = (int64_t{1} << 60) + 1;
    start.satisfied = random.Uniform();
    start.cost = 1e4 * random.Uniform();
    for (int i = 0; i < 50; ++i) {
      std::array<double, kMeasurementParameters> values;
      for (double& value : values) value = std::ldexp(random.Uniform() - 0.5, -i);
      start.scans.push_back({FromArray(values), i % 3 == 0});
    }
    start.bound.emplace();
    start.bound->bound = 100 * random.Uniform();
    start.bound->scans = 12;
    start.bound->converged = true;
    start.bound->evaluations = 300000;
    start.bound->statement = "at least 12 \"scans\" \xC3\xA4\n";
    return start;
  }
  static void ExpectSame(const StartResult& a, const StartResult& b) {
    EXPECT_EQ(a.seed, b.seed);
    EXPECT_EQ(a.stop_reason, b.stop_reason);
    EXPECT_EQ(a.evaluations, b.evaluations);
    EXPECT_EQ(a.satisfied, b.satisfied);
    EXPECT_EQ(a.cost, b.cost);
    EXPECT_EQ(a.scans, b.scans);
    ASSERT_EQ(a.bound.has_value(), b.bound.has_value());
    if (!a.bound) return;
    EXPECT_EQ(a.bound->bound, b.bound->bound);
    EXPECT_EQ(a.bound->scans, b.bound->scans);
    EXPECT_EQ(a.bound->converged, b.bound->converged);
    EXPECT_EQ(a.bound->evaluations, b.bound->evaluations);
    EXPECT_EQ(a.bound->statement, b.bound->statement);
  }

  std::string folder_ = "/tmp/sightline-start-XXXXXX";
};

TEST_F(StartFileTest, ReadsBackEveryBit) {
  const std::string path = folder_ + "/start.json";
  StartResult start = Sample();
  for (const bool with_bound : {true, false}) {
    if (!with_bound) start.bound.reset();
    for (const StopReason reason :
         {StopReason::kGoalReached, StopReason::kMaxScans, StopReason::kMaxTime,
          StopReason::kStalled, StopReason::kInterrupted}) {
      start.stop_reason = reason;
      ASSERT_TRUE(WriteStart(start, "inspection 1", path).ok());
      const auto read = ReadStart(path, "inspection 1", start.seed);
      ASSERT_TRUE(read.has_value());
      ExpectSame(*read, start);
    }
  }
}

TEST_F(StartFileTest, IsNotUsedForAnotherQuestion) {
  const std::string path = folder_ + "/start.json";
  std::string why;
  EXPECT_FALSE(ReadStart(path, "inspection 1", -7, &why).has_value());
  EXPECT_EQ(why, "");  // no file, nothing to say
  ASSERT_TRUE(WriteStart(Sample(), "inspection 1", path).ok());
  EXPECT_TRUE(ReadStart(path, "inspection 1", -7, &why).has_value());
  EXPECT_EQ(why, "");
  EXPECT_FALSE(ReadStart(path, "inspection 2", -7, &why).has_value());
  EXPECT_NE(why.find("another search"), std::string::npos) << why;
  EXPECT_FALSE(ReadStart(path, "inspection 1", 7).has_value());
  EXPECT_FALSE(ReadStart(folder_, "inspection 1", -7).has_value());
}

TEST_F(StartFileTest, IsNotUsedWhenDamaged) {
  const std::string path = folder_ + "/start.json";
  ASSERT_TRUE(WriteStart(Sample(), "inspection 1", path).ok());
  std::ostringstream bytes;
  bytes << std::ifstream(path, std::ios::binary).rdbuf();
  const std::string good = bytes.str();
  const auto write = [&](const std::string& text) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
  };
  // The last byte is the end of the line.
  for (size_t length = 0; length + 1 < good.size(); length += 37) {
    write(good.substr(0, length));
    EXPECT_FALSE(ReadStart(path, "inspection 1", -7).has_value()) << length;
  }
  for (const auto& [from, to] :
       {std::pair("\"max scans\"", "\"tired\""), std::pair("\"locked\":true", "\"locked\":1.5"),
        std::pair("\"parameters\":[", "\"parameters\":[[],"),
        std::pair("\"settled\":", "\"settles\":"),
        // Sound JSON of another result.
        std::pair("\"locked\":true", "\"locked\":false"),
        std::pair("\"evaluations\":1", "\"evaluations\":2")}) {
    std::string wrong = good;
    const size_t at = wrong.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    wrong.replace(at, std::string(from).size(), to);
    write(wrong);
    std::string why;
    EXPECT_FALSE(ReadStart(path, "inspection 1", -7, &why).has_value()) << to;
    EXPECT_NE(why.find("damaged"), std::string::npos) << to << ": " << why;
  }
  write(good);
  EXPECT_TRUE(ReadStart(path, "inspection 1", -7).has_value());
}

}  // namespace
}  // namespace sightline
