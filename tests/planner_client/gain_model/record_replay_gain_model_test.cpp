// SPDX-License-Identifier: Apache-2.0
// Planning that is broken off and run again with its journal makes the plan of an unbroken run.
#include "planner_client/gain_model/record_replay_gain_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "planning/strategy/planner.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr size_t kTargets = 200;

// A target is covered by scans from near its azimuth.
bool Covers(const Measurement& scan, size_t target) {
  const double azimuth = 2 * std::numbers::pi * static_cast<double>(target) / kTargets;
  return std::cos(scan.camera_azimuth_rad - azimuth) > 0.8;
}

class RecordReplayGainModelTest : public testing::Test {
 protected:
  void SetUp() override {
    file_ = (fs::temp_directory_path() /
             ("sightline-journal-" + std::to_string(getpid()) + "-" +
              testing::UnitTest::GetInstance()->current_test_info()->name()))
                .string();
    fs::remove(file_);
  }
  void TearDown() override { fs::remove(file_); }

  static PlannerRequest Request() {
    PlannerRequest request;
    request.domain = ThesisDomain();
    request.goal.coverage = 1;
    request.goal.max_scans = 8;
    request.evaluations_per_scan = 500;
    return request;
  }

  // Result of a run through the journal, and its queries to the gain model behind it.
  struct Run {
    std::vector<std::array<double, kMeasurementParameters>> scans;
    int64_t evaluations = 0;
    int64_t asked = 0;
    int64_t replayed = 0;
    std::vector<std::string> remarks;
  };
  // Stops after so many queries of gains; 0: runs to the end.
  Run Plan(int stop_after_queries, const std::string& fingerprint = "part 1") {
    auto owned = std::make_unique<FunctionGainModel>(kTargets, Covers);
    FunctionGainModel& gain_model = *owned;
    std::atomic<bool> interrupted = false;
    int queries = 0;
    gain_model.set_on_query([&] {
      if (stop_after_queries > 0 && ++queries >= stop_after_queries) interrupted = true;
    });
    Run run;
    auto journal =
        RecordReplayGainModel::Open(std::move(owned), file_, fingerprint,
                                    [&](const std::string& text) { run.remarks.push_back(text); });
    EXPECT_TRUE(journal.ok()) << journal.status();
    PlannerRequest request = Request();
    request.interrupted = &interrupted;
    auto plan = MakePlan(**journal, request);
    EXPECT_TRUE(plan.ok()) << plan.status();
    for (const ChosenScan& scan : plan->scans) run.scans.push_back(ToArray(scan.measurement));
    run.evaluations = plan->evaluations;
    run.asked = gain_model.evaluations();
    run.replayed = (*journal)->replayed_queries();
    return run;
  }

  std::string file_;
};

TEST_F(RecordReplayGainModelTest, GoesOnWhereItWasBrokenOff) {
  FunctionGainModel gain_model(kTargets, Covers);
  auto whole = MakePlan(gain_model, Request());
  ASSERT_TRUE(whole.ok()) << whole.status();
  ASSERT_GT(whole->scans.size(), 2u);
  Plan(5);
  const Run second = Plan(20);
  EXPECT_GT(second.replayed, 0);
  const Run last = Plan(0);
  EXPECT_GT(last.replayed, second.replayed);
  std::vector<std::array<double, kMeasurementParameters>> expected;
  for (const ChosenScan& scan : whole->scans) expected.push_back(ToArray(scan.measurement));
  EXPECT_EQ(last.scans, expected);
  EXPECT_EQ(last.evaluations, whole->evaluations);
  EXPECT_LT(last.asked, whole->evaluations);
}

TEST_F(RecordReplayGainModelTest, AFinishedRunAsksNothingAgain) {
  const Run first = Plan(0);
  const Run again = Plan(0);
  EXPECT_EQ(again.scans, first.scans);
  EXPECT_EQ(again.evaluations, first.evaluations);
  EXPECT_EQ(again.asked, 0);
}

// A process that is killed while it writes leaves a piece of an answer.
TEST_F(RecordReplayGainModelTest, AnAnswerCutAnywhereIsAskedAgain) {
  const Run first = Plan(0);
  const auto size = static_cast<int64_t>(fs::file_size(file_));
  for (const int64_t cut : {int64_t{1}, int64_t{15}, int64_t{100}, size / 2, size - 22}) {
    fs::resize_file(file_, static_cast<uintmax_t>(size - cut));
    const Run again = Plan(0);
    EXPECT_EQ(again.scans, first.scans) << cut;
    EXPECT_EQ(static_cast<int64_t>(fs::file_size(file_)), size) << cut;
  }
}

TEST_F(RecordReplayGainModelTest, ADamagedAnswerIsAskedAgain) {
  const Run first = Plan(0);
  const auto size = static_cast<std::streamoff>(fs::file_size(file_));
  {
    std::fstream file(file_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(size / 2);
    const std::string garbage(64, '\x5a');
    file.write(garbage.data(), static_cast<std::streamsize>(garbage.size()));
  }
  const Run again = Plan(0);
  EXPECT_EQ(again.scans, first.scans);
  EXPECT_EQ(again.evaluations, first.evaluations);
  EXPECT_GT(again.asked, 0);
  // It is named, once, and remade: nothing is said of it the next time.
  EXPECT_THAT(again.remarks, ElementsAre(AllOf(HasSubstr(file_), HasSubstr("is damaged"))));
  const Run last = Plan(0);
  EXPECT_EQ(last.asked, 0);
  EXPECT_THAT(last.remarks, IsEmpty());
}

// The count that a gain model keeps is its own: some queries cost nothing, others more than a scan
// each.
class CountingGainModel final : public FunctionGainModel {
 public:
  CountingGainModel() : FunctionGainModel(kTargets, sightline::Covers) {}
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override {
    gains_ += 7;
    return FunctionGainModel::Gains(measurements, known);
  }
  int64_t evaluations() const override { return gains_; }

 private:
  int64_t gains_ = 0;
};

TEST_F(RecordReplayGainModelTest, CountsAsTheGainModelAloneWouldHaveCounted) {
  CountingGainModel alone;
  const auto count = [](GainModel& gain_model) {
    const std::vector<Measurement> scans(3);
    const std::vector<float> known(kTargets, 0.0f);
    EXPECT_TRUE(gain_model.Gains(scans, known).ok());
    EXPECT_TRUE(gain_model.FastCoverage(scans).ok());
    EXPECT_TRUE(gain_model.Gains(scans, known).ok());
    return gain_model.evaluations();
  };
  const int64_t expected = count(alone);
  EXPECT_EQ(expected, 14);
  for (const bool replayed : {false, true}) {
    auto journal =
        RecordReplayGainModel::Open(std::make_unique<CountingGainModel>(), file_, "part 1");
    ASSERT_TRUE(journal.ok()) << journal.status();
    EXPECT_EQ(count(**journal), expected) << replayed;
    EXPECT_EQ((*journal)->replayed_queries(), replayed ? 3 : 0);
  }
}

TEST_F(RecordReplayGainModelTest, AnswersOfAnotherPartAreNotUsed) {
  const Run first = Plan(0);
  const Run other = Plan(0, "part 2");
  EXPECT_EQ(other.replayed, 0);
  EXPECT_EQ(other.asked, first.asked);
  EXPECT_THAT(first.remarks, IsEmpty());
  EXPECT_THAT(other.remarks, ElementsAre(HasSubstr("another task")));
}

// For the journal of another search.
TEST_F(RecordReplayGainModelTest, GivesItsGainModelBack) {
  auto owned = std::make_unique<FunctionGainModel>(kTargets, Covers);
  const GainModel* gain_model = owned.get();
  auto journal = RecordReplayGainModel::Open(std::move(owned), file_, "part 1");
  ASSERT_TRUE(journal.ok()) << journal.status();
  const std::unique_ptr<GainModel> back = (*journal)->Release();
  EXPECT_EQ(back.get(), gain_model);
}

TEST_F(RecordReplayGainModelTest, SaysWhenItCannotWrite) {
  auto gain_model = std::make_unique<FunctionGainModel>(kTargets, Covers);
  EXPECT_FALSE(
      RecordReplayGainModel::Open(std::move(gain_model), "/no/such/folder/journal", "x").ok());
}

}  // namespace
}  // namespace sightline
