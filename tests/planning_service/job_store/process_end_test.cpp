// SPDX-License-Identifier: Apache-2.0
// Processes that end in the middle of things.
#include <unistd.h>

#include <random>

#include "absl/time/clock.h"
#include "planning_service/job_store/planning_job_store.h"
#include "tests/limits/wait_until.h"
#include "tests/planning_service/job_store/store_fixture.h"

namespace sightline {
namespace {

class ProcessEndTest : public StoreTest {
 protected:
  absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenInProcess() const {
    return GetParam() == Backend::kSqlite ? OpenSqliteJobStore(location_)
                                          : OpenPostgresJobStore(location_);
  }
};

INSTANTIATE_TEST_SUITE_P(Databases, ProcessEndTest,
                         testing::Values(Backend::kSqlite, Backend::kPostgres), BackendName);

TEST_P(ProcessEndTest, AcceptedJobsOutliveAnyEnd) {
  std::mt19937 random(20240607);
  std::vector<std::string> accepted;
  for (int round = 0; round < 20; ++round) {
    Process process([&](int output) {
      const auto store = OpenInProcess();
      if (!store.ok()) {
        std::fprintf(stderr, "%s\n", store.status().ToString().c_str());
        return;
      }
      while (true) {
        NewPlanningJob asked = NewJob();
        asked.task.assign(20'000, 'x');
        asked.files = {File("part.stl", 'a', 1)};
        ClientQuota quota;
        quota.max_queued_jobs = 100'000;  // how many there will be, the disk decides
        const auto job = (*store)->Create(asked, quota);
        if (!job.ok()) {
          std::fprintf(stderr, "%s\n", job.status().ToString().c_str());
          return;
        }
        WriteLine(output, job->job_id);
      }
    });
    accepted.push_back(process.ReadLine());
    ASSERT_NE(accepted.back(), "");
    absl::SleepFor(absl::Microseconds(std::uniform_int_distribution<>(0, 50'000)(random)));
    process.Kill();
    for (std::string id = process.ReadLine(); !id.empty(); id = process.ReadLine()) {
      accepted.push_back(id);
    }
    Reopen();
    for (const std::string& id : accepted) {
      const auto job = store_->Get(id);
      ASSERT_TRUE(job.ok()) << job.status();
      ASSERT_EQ(job->task.size(), 20'000u);
      ASSERT_EQ(job->files.size(), 1u);
      ASSERT_EQ(EventTypes(id), std::vector<std::string>{"accepted"});
    }
    store_.reset();
  }
  // Jobs whose Create had not returned yet are there whole or not at all.
  Reopen();
  const auto events = store_->Events(0, std::nullopt, 10'000);
  const auto jobs = store_->List(AllJobs());
  ASSERT_TRUE(events.ok() && jobs.ok());
  EXPECT_EQ(events->size(), jobs->size());
  EXPECT_GE(jobs->size(), accepted.size());
  EXPECT_LE(jobs->size(), accepted.size() + 20);
  for (size_t i = 0; i < events->size(); ++i) {
    EXPECT_EQ((*events)[i].sequence, static_cast<int64_t>(i + 1));
  }
}

TEST_P(ProcessEndTest, ClaimedJobGoesBackWhenItsOwnerDies) {
  Reopen();
  const PlanningJob made = Create();
  if (GetParam() == Backend::kSqlite) store_.reset();
  Process process([&](int output) {
    const auto store = OpenInProcess();
    if (!store.ok()) return;
    const auto job = (*store)->Claim(NoQuota);
    if (!job.ok() || !*job) return;
    WriteLine(output, (*job)->job_id);
    while (true) pause();
  });
  ASSERT_EQ(process.ReadLine(), made.job_id);
  if (GetParam() == Backend::kPostgres) {
    EXPECT_EQ(*store_->RequeueOrphans(), 0);  // the other lives
  }
  process.Kill();
  if (GetParam() == Backend::kSqlite) Reopen();
  // A database may need a moment to see that a connection has gone.
  int requeued = 0;
  WaitUntil([&] { return (requeued = *store_->RequeueOrphans()) > 0; });
  EXPECT_EQ(requeued, 1);
  const PlanningJob again = Claim();
  EXPECT_EQ(again.job_id, made.job_id);
  EXPECT_EQ(again.attempts, 2);
  EXPECT_EQ(again.crashes, 1);
}

}  // namespace
}  // namespace sightline
