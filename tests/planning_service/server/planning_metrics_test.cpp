// SPDX-License-Identifier: Apache-2.0
#include "planning_service/server/planning_metrics.h"

#include <gtest/gtest.h>
#include <prometheus/text_serializer.h>
#include <stdlib.h>

#include <filesystem>
#include <map>
#include <sstream>
#include <string>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

class PlanningMetricsTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    auto store = OpenSqliteJobStore(folder_ + "/jobs.sqlite");
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
  }
  void TearDown() override {
    store_.reset();
    std::filesystem::remove_all(folder_);
  }

  void Create(const std::string& kind) {
    NewPlanningJob job;
    job.client = "mes";
    job.kind = kind;
    job.fingerprint = kind;
    const auto made = store_->Create(job, {});
    ASSERT_TRUE(made.ok()) << made.status();
  }
  Attempt Claim() {
    const auto job = store_->Claim([](const std::string&) { return ClientQuota(); });
    EXPECT_TRUE(job.ok() && *job) << job.status();
    return {(*job)->job_id, (*job)->attempts};
  }
  void Succeed(const Attempt& attempt) {
    ASSERT_TRUE(store_->Succeed(attempt, {{"plan.json", std::string(64, 'a'), 1}}).ok());
  }

  // The metrics of a scrape: value by name and labels.
  static std::map<std::string, double> Scrape(PlanningMetrics* metrics) {
    std::istringstream text(
        prometheus::TextSerializer().Serialize(metrics->collectable()->Collect()));
    std::map<std::string, double> values;
    for (std::string line; std::getline(text, line);) {
      const size_t space = line.rfind(' ');
      if (line.empty() || line[0] == '#' || space == std::string::npos) continue;
      values[line.substr(0, space)] = std::stod(line.substr(space + 1));
    }
    return values;
  }

  std::string folder_ = "/tmp/sightline-metrics-XXXXXX";
  std::unique_ptr<PlanningJobStore> store_;
};

std::string Ended(const std::string& kind, const std::string& outcome) {
  return absl::StrCat("sightline_jobs_total{kind=\"", kind, "\",outcome=\"", outcome, "\"}");
}

TEST_F(PlanningMetricsTest, CountsWhatWaitsRunsAndEnded) {
  PlanningMetrics metrics;
  EXPECT_EQ(Scrape(&metrics)["sightline_job_store_up"], 0) << "no store yet";
  metrics.SetStore(store_.get());
  for (int i = 0; i < 5; ++i) Create("plan");
  Create("render");
  Succeed(Claim());
  ASSERT_TRUE(store_->Fail(Claim(), {absl::StatusCode::kInternal, "PROCESS_ENDED", "why"}).ok());
  ASSERT_TRUE(store_->Requeue(Claim(), /*crashed=*/true, /*advanced=*/false).ok());
  Succeed(Claim());  // the one that broke off
  Claim();
  auto values = Scrape(&metrics);
  EXPECT_EQ(values["sightline_job_store_up"], 1);
  EXPECT_EQ(values["sightline_jobs_queued"], 2);
  EXPECT_EQ(values["sightline_jobs_running"], 1);
  EXPECT_EQ(values[Ended("plan", "succeeded")], 2);
  EXPECT_EQ(values[Ended("plan", "failed")], 1);
  EXPECT_EQ(values.count(Ended("render", "succeeded")), 0u);
  EXPECT_EQ(values["sightline_job_attempts_total{kind=\"plan\"}"], 4);
  EXPECT_EQ(values["sightline_job_seconds_count{kind=\"plan\"}"], 2);
  EXPECT_EQ(values["sightline_stored_bytes"], 1) << "the same file counts once";

  // Nothing is counted twice, and what ends later is counted.
  EXPECT_EQ(Scrape(&metrics), values);
  const auto queued = store_->List({.client = {}, .states = {JobState::kQueued}, .kinds = {}});
  ASSERT_TRUE(queued.ok());
  for (const PlanningJob& job : *queued) ASSERT_TRUE(store_->RequestCancel(job.job_id).ok());
  values = Scrape(&metrics);
  EXPECT_EQ(values["sightline_jobs_queued"], 0);
  EXPECT_EQ(values[Ended("plan", "cancelled")] + values[Ended("render", "cancelled")], 2);
}

TEST_F(PlanningMetricsTest, CountsFromItsStartOn) {
  Create("plan");
  Succeed(Claim());
  PlanningMetrics metrics;
  metrics.SetStore(store_.get());
  EXPECT_EQ(Scrape(&metrics).count(Ended("plan", "succeeded")), 0u);
  Create("plan");
  Succeed(Claim());
  EXPECT_EQ(Scrape(&metrics)[Ended("plan", "succeeded")], 1);
}

}  // namespace
}  // namespace sightline
