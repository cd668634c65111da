// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <thread>

#include "planning_service/job_store/planning_job_store.h"
#include "planning_service/job_store/sql_job_store.h"
#include "proto/status/rpc_status.h"
#include "tests/planning_service/job_store/store_fixture.h"

namespace sightline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using testing::UnorderedElementsAre;

constexpr char kTraceparent[] = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

class JobStoreTest : public StoreTest {
 protected:
  // Changes the database while no store is open.
  void Change(const std::string& sql) {
    store_.reset();
    {
      const auto database = OpenDatabase();
      const auto connection = database->Connect();
      ASSERT_TRUE((*connection)->Begin(SqlAccess::kWrite).ok());
      ASSERT_TRUE((*connection)->Run(sql, {}).ok());
      ASSERT_TRUE((*connection)->Commit().ok());
    }
    Reopen();
  }

  JobStoreTest() { Reopen(); }
};

INSTANTIATE_TEST_SUITE_P(Databases, JobStoreTest,
                         testing::Values(Backend::kSqlite, Backend::kPostgres), BackendName);

TEST_P(JobStoreTest, KeepsWhatItWasGiven) {
  NewPlanningJob asked = NewJob("mes", 7);
  asked.request_id = "order \xc3\xbc 1";
  asked.traceparent = kTraceparent;
  asked.files = {File("part.stl", 'a', 10), File("sub/other.stl", 'b', 20)};
  const auto made = store_->Create(asked, {});
  ASSERT_TRUE(made.ok()) << made.status();
  EXPECT_THAT(made->job_id, testing::MatchesRegex("job-[0-9a-f]{32}"));

  for (const bool reopened : {false, true}) {
    if (reopened) Reopen();
    const auto job = store_->Get(made->job_id);
    ASSERT_TRUE(job.ok()) << job.status();
    EXPECT_EQ(job->sequence, 1);
    EXPECT_EQ(job->client, "mes");
    EXPECT_EQ(job->kind, "plan");
    EXPECT_EQ(job->request_id, asked.request_id);
    EXPECT_EQ(job->traceparent, kTraceparent);
    EXPECT_EQ(job->fingerprint, "f");
    EXPECT_EQ(job->task, asked.task);
    EXPECT_EQ(job->files, asked.files);
    EXPECT_EQ(job->priority, 7);
    EXPECT_EQ(job->state, JobState::kQueued);
    EXPECT_EQ(job->progress, 0);
    EXPECT_EQ(job->attempts, 0);
    EXPECT_EQ(job->created, made->created);
    EXPECT_EQ(job->started, absl::InfinitePast());
    EXPECT_EQ(job->finished, absl::InfinitePast());
    EXPECT_EQ(job->revision, made->revision);
    EXPECT_THAT(job->results, IsEmpty());
  }
}

// One worker takes the jobs in the order of their numbers, for all clients and ways of asking.
TEST_P(JobStoreTest, JobsAheadAreThoseThatAreClaimedBefore) {
  const std::vector<std::pair<std::string, int>> asked = {
      {"mes", 0}, {"line", 5}, {"mes", 5}, {"mes", -3}, {"other", 0}, {"line", 0}, {"mes", 0}};
  for (const auto& [client, priority] : asked) {
    const auto queued = store_->List({});
    ASSERT_TRUE(queued.ok()) << queued.status();
    int64_t before = 0;
    for (const PlanningJob& job : *queued) before += job.priority >= priority ? 1 : 0;
    EXPECT_EQ(Create(client, priority).jobs_ahead, before);
  }
  for (size_t left = asked.size(); left > 0; --left) {
    std::set<int64_t> places;
    std::string first;
    const auto listed = store_->List({});
    ASSERT_TRUE(listed.ok()) << listed.status();
    for (const PlanningJob& job : *listed) {
      EXPECT_EQ(store_->Get(job.job_id)->jobs_ahead, job.jobs_ahead);
      if (job.state != JobState::kQueued) {
        EXPECT_FALSE(job.jobs_ahead.has_value());
        continue;
      }
      ASSERT_TRUE(job.jobs_ahead.has_value());
      places.insert(*job.jobs_ahead);
      if (*job.jobs_ahead == 0) first = job.job_id;
      // Filters choose what is shown, not what is counted.
      const auto own = store_->List(JobsOfClient(job.client));
      ASSERT_TRUE(own.ok()) << own.status();
      for (const PlanningJob& shown : *own) {
        if (shown.job_id != job.job_id) continue;
        EXPECT_EQ(shown.jobs_ahead, job.jobs_ahead);
      }
    }
    // Every place once, without gaps.
    EXPECT_EQ(places.size(), left);
    EXPECT_EQ(*places.begin(), 0);
    EXPECT_EQ(*places.rbegin(), static_cast<int64_t>(left) - 1);
    const PlanningJob claimed = Claim();
    EXPECT_EQ(claimed.job_id, first);
    EXPECT_FALSE(claimed.jobs_ahead.has_value());
    ASSERT_TRUE(store_->Succeed(AttemptOf(claimed), {}).ok());
  }
}

TEST_P(JobStoreTest, EventsHaveNoJobsAhead) {
  Create();
  const PlanningJob second = Create();
  EXPECT_EQ(second.jobs_ahead, 1);
  const auto events = store_->Events(0, second.job_id, 10);
  ASSERT_TRUE(events.ok() && !events->empty()) << events.status();
  for (const JobEvent& event : *events) {
    EXPECT_FALSE(event.job.jobs_ahead.has_value());
  }
  EXPECT_FALSE(store_->RequestCancel(second.job_id)->jobs_ahead.has_value());
}

TEST_P(JobStoreTest, EmptyTaskStaysEmpty) {
  NewPlanningJob asked = NewJob();
  asked.task = "";
  const auto made = store_->Create(asked, {});
  ASSERT_TRUE(made.ok()) << made.status();
  EXPECT_EQ(store_->Get(made->job_id)->task, "");
}

TEST_P(JobStoreTest, UnknownJobs) {
  for (const std::string& id : {std::string("job-0"), std::string("a\0b", 3), std::string("\xff"),
                                std::string("'; DROP TABLE job; --")}) {
    for (const absl::Status& status :
         {store_->Get(id).status(), store_->RequestCancel(id).status(),
          store_->WaitForChange(id, 0, absl::InfiniteDuration()).status()}) {
      EXPECT_TRUE(absl::IsNotFound(status)) << status;
      EXPECT_EQ(ErrorReason(status), "JOB_UNKNOWN");
    }
  }
  EXPECT_THAT(*store_->List({}), IsEmpty());
}

TEST_P(JobStoreTest, SameRequestGivesSameJob) {
  NewPlanningJob asked = NewJob();
  asked.request_id = "order-1";
  ClientQuota quota;
  quota.max_queued_jobs = 1;
  quota.max_stored_bytes = 0;
  const auto first = store_->Create(asked, quota);
  ASSERT_TRUE(first.ok()) << first.status();
  // A repeated request succeeds whatever the quota says.
  const auto again = store_->Create(asked, quota);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->job_id, first->job_id);
  EXPECT_EQ(again->task, asked.task);
  EXPECT_THAT(EventTypes(first->job_id), ElementsAre("accepted"));

  Reopen();
  EXPECT_EQ(store_->Create(asked, {})->job_id, first->job_id);
  // A request of another client is another one; so is one without a name.
  asked.client = "other";
  EXPECT_NE(store_->Create(asked, {})->job_id, first->job_id);
  EXPECT_NE(Create().job_id, Create().job_id);
  EXPECT_THAT(*store_->List({}), SizeIs(4));
}

TEST_P(JobStoreTest, RefusesRequestIdOfAnotherTask) {
  NewPlanningJob asked = NewJob();
  asked.request_id = "order-1";
  const auto first = store_->Create(asked, {});
  asked.fingerprint = "another";
  const auto refused = store_->Create(asked, {});
  EXPECT_TRUE(absl::IsAlreadyExists(refused.status())) << refused.status();
  EXPECT_EQ(ErrorReason(refused.status()), "REQUEST_ID_REUSED");
  EXPECT_THAT(refused.status().message(), HasSubstr("order-1"));
  EXPECT_THAT(*store_->List({}), SizeIs(1));
}

TEST_P(JobStoreTest, SameRequestFromManyThreadsIsOneJob) {
  NewPlanningJob asked = NewJob();
  asked.request_id = "order-1";
  std::vector<std::string> ids(8);
  std::vector<std::thread> threads;
  for (std::string& id : ids) {
    threads.emplace_back(
        [&, this] { id = store_->Create(asked, {}).value_or(PlanningJob()).job_id; });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_THAT(ids, testing::Each(ids[0]));
  EXPECT_NE(ids[0], "");
}

TEST_P(JobStoreTest, RefusesNamesThatAreNoText) {
  for (const std::string& bad : {std::string("a\0b", 3), std::string("\xff")}) {
    NewPlanningJob asked = NewJob();
    asked.request_id = bad;
    const absl::Status request = store_->Create(asked, {}).status();
    EXPECT_TRUE(absl::IsInvalidArgument(request)) << request;
    ASSERT_THAT(FieldViolations(request), SizeIs(1));
    EXPECT_EQ(FieldViolations(request)[0].field, "request_id");

    asked = NewJob();
    asked.files = {File("good", 'a', 1), File(bad, 'a', 1)};
    const absl::Status file = store_->Create(asked, {}).status();
    ASSERT_THAT(FieldViolations(file), SizeIs(1));
    EXPECT_EQ(FieldViolations(file)[0].field, "files[1].name");
  }
  EXPECT_THAT(*store_->List({}), IsEmpty());
}

TEST_P(JobStoreTest, ClaimsByPriorityThenFairShareThenAge) {
  const PlanningJob a1 = Create("a"), a2 = Create("a"), a3 = Create("a"), b1 = Create("b");
  const PlanningJob urgent = Create("a", 5), later = Create("c", -1);
  std::vector<std::string> order;
  for (int i = 0; i < 6; ++i) order.push_back(Claim().job_id);
  // After the urgent one, a runs one and b none.
  EXPECT_THAT(order,
              ElementsAre(urgent.job_id, b1.job_id, a1.job_id, a2.job_id, a3.job_id, later.job_id));
  EXPECT_EQ(*store_->Claim(NoQuota), std::nullopt);
}

TEST_P(JobStoreTest, ClaimLeavesOutClientsThatRunTheirMost) {
  Create("a", 9);
  Create("a", 9);
  const PlanningJob b = Create("b");
  const auto quota_of = [](const std::string& client) {
    ClientQuota quota;
    quota.max_running_jobs = client == "a" ? 1 : 0;
    return quota;
  };
  const auto first = store_->Claim(quota_of);
  ASSERT_TRUE(first.ok() && *first) << first.status();
  EXPECT_EQ((*first)->client, "a");
  EXPECT_EQ(*store_->Claim(quota_of), std::nullopt);
  ASSERT_TRUE(store_->Succeed(AttemptOf(**first), {}).ok());
  EXPECT_EQ((*store_->Claim(quota_of))->client, "a");
  EXPECT_EQ(store_->Get(b.job_id)->state, JobState::kQueued);
}

TEST_P(JobStoreTest, ClaimedJobRuns) {
  const PlanningJob made = Create();
  const PlanningJob job = Claim();
  EXPECT_EQ(job.job_id, made.job_id);
  EXPECT_EQ(job.state, JobState::kRunning);
  EXPECT_EQ(job.attempts, 1);
  EXPECT_EQ(job.task, made.task);
  EXPECT_GT(job.revision, made.revision);
  EXPECT_NE(job.started, absl::InfinitePast());
  const auto counts = store_->Count("mes");
  EXPECT_EQ(counts->queued, 0);
  EXPECT_EQ(counts->running, 1);
}

TEST_P(JobStoreTest, QuotaOfQueuedJobs) {
  ClientQuota quota;
  quota.max_queued_jobs = 2;
  ASSERT_TRUE(store_->Create(NewJob(), quota).ok());
  ASSERT_TRUE(store_->Create(NewJob(), quota).ok());
  const absl::Status refused = store_->Create(NewJob(), quota).status();
  EXPECT_TRUE(absl::IsResourceExhausted(refused)) << refused;
  EXPECT_EQ(ErrorReason(refused), "QUOTA_EXCEEDED");
  EXPECT_THAT(refused.message(), HasSubstr("max_queued_jobs"));
  EXPECT_TRUE(store_->Create(NewJob("other"), quota).ok());
  Claim();
  EXPECT_TRUE(store_->Create(NewJob(), quota).ok());
}

TEST_P(JobStoreTest, QuotaOfStoredBytesCountsDifferentFilesOnce) {
  ClientQuota quota;
  quota.max_stored_bytes = 100;
  ASSERT_TRUE(store_->AddUpload("mes", File("", 'a', 60), quota).ok());
  // In a job and a recipe it takes no more room.
  NewPlanningJob asked = NewJob();
  asked.files = {File("part.stl", 'a', 60), File("copy.stl", 'a', 60)};
  ASSERT_TRUE(store_->Create(asked, quota).ok());
  ASSERT_TRUE(store_->PutRecipe({"mes", "r", "plan", "f", "t", {File("p", 'a', 60)}}, quota).ok());
  EXPECT_EQ(store_->Count("mes")->stored_bytes, 60);

  const absl::Status upload = store_->AddUpload("mes", File("", 'b', 41), quota);
  EXPECT_EQ(ErrorReason(upload), "QUOTA_EXCEEDED") << upload;
  EXPECT_THAT(upload.message(), HasSubstr("max_stored_bytes"));
  EXPECT_EQ(*store_->FindFile("mes", std::string(64, 'b')), std::nullopt);
  EXPECT_TRUE(store_->AddUpload("mes", File("", 'b', 40), quota).ok());

  asked.files.push_back(File("more.stl", 'c', 1));
  EXPECT_EQ(ErrorReason(store_->Create(asked, quota).status()), "QUOTA_EXCEEDED");
  EXPECT_EQ(
      ErrorReason(store_->PutRecipe({"mes", "s", "plan", "f", "t", {File("p", 'c', 1)}}, quota)),
      "QUOTA_EXCEEDED");
  EXPECT_THAT(*store_->List({}), SizeIs(1));
  EXPECT_EQ(*store_->CountRecipes("mes"), 1);

  // Results count, and are taken whatever the quota.
  ASSERT_TRUE(store_->Succeed(AttemptOf(Claim()), {File("plan.json", 'd', 1000)}).ok());
  EXPECT_EQ(store_->Count("mes")->stored_bytes, 1100);
  EXPECT_EQ(ErrorReason(store_->Create(NewJob(), quota).status()), "QUOTA_EXCEEDED");
  // The client may upload again the files that it holds.
  EXPECT_TRUE(store_->AddUpload("mes", File("", 'a', 60), quota).ok());

  ASSERT_TRUE(store_->AddUpload("other", File("", 'a', 60), quota).ok());
  EXPECT_EQ(store_->Count("other")->stored_bytes, 60);
  EXPECT_EQ(store_->Count(std::nullopt)->stored_bytes, 1100);
}

TEST_P(JobStoreTest, SucceedsWithResults) {
  const PlanningJob made = Create();
  const std::vector<JobFile> results = {File("plan.json", 'a', 1), File("points/1.ply", 'b', 2)};
  ASSERT_TRUE(store_->Succeed(AttemptOf(Claim()), results).ok());
  const auto job = store_->Get(made.job_id);
  EXPECT_EQ(job->state, JobState::kSucceeded);
  EXPECT_EQ(job->progress, 1);
  EXPECT_EQ(job->results, results);
  EXPECT_NE(job->finished, absl::InfinitePast());
  const auto events = store_->Events(0, made.job_id, 10);
  ASSERT_THAT(*events, SizeIs(2));
  EXPECT_EQ((*events)[1].job.results, results);
  EXPECT_EQ((*events)[1].job.revision, job->revision);
}

TEST_P(JobStoreTest, FailsWithReason) {
  const PlanningJob made = Create();
  const std::string message = "GLB: \xff is no text";
  ASSERT_TRUE(store_
                  ->Fail(AttemptOf(Claim()),
                         {absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", message})
                  .ok());
  const auto job = store_->Get(made.job_id);
  EXPECT_EQ(job->state, JobState::kFailed);
  EXPECT_EQ(job->failure, (JobFailure{absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY",
                                      "GLB: \xef\xbf\xbd is no text"}));
  const auto events = store_->Events(0, made.job_id, 10);
  ASSERT_THAT(*events, SizeIs(2));
  EXPECT_EQ((*events)[1].type, "failed");
  EXPECT_EQ((*events)[1].job.failure, job->failure);
}

TEST_P(JobStoreTest, FinishedJobsNeverChange) {
  using End = std::function<absl::Status(const Attempt&)>;
  const std::map<JobState, End> ends = {
      {JobState::kSucceeded, [&](const Attempt& a) { return store_->Succeed(a, {}); }},
      {JobState::kFailed,
       [&](const Attempt& a) {
         return store_->Fail(a, {absl::StatusCode::kInternal, "", "m"});
       }},
      {JobState::kCancelled, [&](const Attempt& a) { return store_->MarkCancelled(a); }}};
  for (const auto& [state, end] : ends) {
    Create();
    const Attempt attempt = AttemptOf(Claim());
    ASSERT_TRUE(end(attempt).ok());
    const auto before = store_->Get(attempt.job_id);
    ASSERT_EQ(before->state, state);
    for (const auto& [other, again] : ends) EXPECT_TRUE(absl::IsAborted(again(attempt)));
    EXPECT_TRUE(absl::IsAborted(store_->ReportProgress(attempt, 0.5, "m").status()));
    EXPECT_TRUE(absl::IsAborted(store_->Requeue(attempt, false, false)));
    EXPECT_EQ(store_->RequestCancel(attempt.job_id)->state, state);
    EXPECT_EQ(*store_->RequeueOrphans(), 0);
    Reopen();
    EXPECT_EQ(*store_->RequeueOrphans(), 0);
    EXPECT_EQ(*store_->Claim(NoQuota), std::nullopt);
    const auto after = store_->Get(attempt.job_id);
    EXPECT_EQ(after->state, state);
    EXPECT_EQ(after->revision, before->revision);
    EXPECT_EQ(after->finished, before->finished);
    EXPECT_THAT(EventTypes(attempt.job_id), SizeIs(2));
  }
}

TEST_P(JobStoreTest, AttemptsOfAnotherNumberAreAborted) {
  const PlanningJob made = Create();
  EXPECT_TRUE(absl::IsAborted(store_->Succeed({made.job_id, 0}, {})));  // is queued
  const Attempt first = AttemptOf(Claim());
  ASSERT_TRUE(store_->Requeue(first, false, false).ok());
  EXPECT_TRUE(absl::IsAborted(store_->Succeed(first, {})));
  const Attempt second = AttemptOf(Claim());
  EXPECT_EQ(second.number, 2);
  for (const int number : {0, 1, 3}) {
    const Attempt stale = {made.job_id, number};
    EXPECT_TRUE(absl::IsAborted(store_->ReportProgress(stale, 0.5, "m").status()));
    EXPECT_TRUE(absl::IsAborted(store_->Succeed(stale, {})));
    EXPECT_TRUE(absl::IsAborted(store_->Fail(stale, {})));
    EXPECT_TRUE(absl::IsAborted(store_->MarkCancelled(stale)));
    EXPECT_TRUE(absl::IsAborted(store_->Requeue(stale, true, true)));
  }
  EXPECT_TRUE(absl::IsAborted(store_->Succeed({"job-0", 1}, {})));
  EXPECT_EQ(store_->Get(made.job_id)->state, JobState::kRunning);
  EXPECT_TRUE(store_->Succeed(second, {}).ok());
}

TEST_P(JobStoreTest, RequeuedJobKeepsItsPlaceAndCountsCrashes) {
  const PlanningJob first = Create();
  Create();
  const auto crash = [&](bool crashed, bool advanced) {
    const PlanningJob job = Claim();
    EXPECT_EQ(job.job_id, first.job_id);
    EXPECT_TRUE(store_->Requeue(AttemptOf(job), crashed, advanced).ok());
    const auto after = store_->Get(first.job_id);
    EXPECT_EQ(after->state, JobState::kQueued);
    return after->crashes;
  };
  EXPECT_EQ(crash(true, false), 1);
  EXPECT_EQ(crash(true, false), 2);
  EXPECT_EQ(crash(false, false), 2);  // was asked to stop: says nothing about the job
  EXPECT_EQ(crash(true, true), 1);
  EXPECT_EQ(crash(true, false), 2);
  EXPECT_EQ(crash(false, true), 0);
  EXPECT_EQ(store_->Get(first.job_id)->attempts, 6);
}

TEST_P(JobStoreTest, OrphansGoBackToTheQueue) {
  const PlanningJob made = Create();
  Create();
  const Attempt attempt = AttemptOf(Claim());
  ASSERT_TRUE(store_->ReportProgress(attempt, 0.25, "half way to half").ok());
  EXPECT_EQ(*store_->RequeueOrphans(), 0);  // our own
  Reopen();
  EXPECT_TRUE(absl::IsAborted(store_->Succeed(attempt, {})));  // of the owner before
  EXPECT_EQ(*store_->RequeueOrphans(), 1);
  EXPECT_EQ(*store_->RequeueOrphans(), 0);
  const auto job = store_->Get(made.job_id);
  EXPECT_EQ(job->state, JobState::kQueued);
  EXPECT_EQ(job->crashes, 1);
  EXPECT_EQ(job->progress, 0.25);

  // Each crash at the same place counts; one further on starts anew.
  const std::vector<std::pair<double, int>> reports = {{0.25, 2}, {0.1, 3}, {0.5, 1}, {0.5, 2}};
  for (const auto& [progress, crashes] : reports) {
    const PlanningJob again = Claim();
    EXPECT_EQ(again.job_id, made.job_id);
    ASSERT_TRUE(store_->ReportProgress(AttemptOf(again), progress, "m").ok());
    Reopen();
    EXPECT_EQ(*store_->RequeueOrphans(), 1);
    EXPECT_EQ(store_->Get(made.job_id)->crashes, crashes) << progress;
  }
}

TEST_P(JobStoreTest, CancelsQueuedJobAtOnce) {
  const PlanningJob made = Create();
  const auto cancelled = store_->RequestCancel(made.job_id);
  EXPECT_EQ(cancelled->state, JobState::kCancelled);
  EXPECT_GT(cancelled->revision, made.revision);
  EXPECT_EQ(*store_->Claim(NoQuota), std::nullopt);
  EXPECT_EQ(store_->RequestCancel(made.job_id)->revision, cancelled->revision);
  EXPECT_THAT(EventTypes(made.job_id), ElementsAre("accepted", "cancelled"));
}

TEST_P(JobStoreTest, AsksRunningJobToStop) {
  const PlanningJob made = Create();
  const Attempt attempt = AttemptOf(Claim());
  EXPECT_FALSE(*store_->ReportProgress(attempt, 0.1, "m"));
  const auto asked = store_->RequestCancel(made.job_id);
  EXPECT_EQ(asked->state, JobState::kRunning);
  EXPECT_TRUE(asked->cancel_requested);
  EXPECT_EQ(store_->RequestCancel(made.job_id)->revision, asked->revision);
  EXPECT_TRUE(*store_->ReportProgress(attempt, 0.1, "m"));  // also when it says nothing new
  EXPECT_TRUE(*store_->ReportProgress(attempt, 0.2, "m"));
  ASSERT_TRUE(store_->MarkCancelled(attempt).ok());
  const auto job = store_->Get(made.job_id);
  EXPECT_EQ(job->state, JobState::kCancelled);
  EXPECT_FALSE(job->cancel_requested);
}

TEST_P(JobStoreTest, JobAskedToStopIsNotRunAgain) {
  const PlanningJob first = Create();
  const Attempt attempt = AttemptOf(Claim());
  ASSERT_TRUE(store_->RequestCancel(first.job_id).ok());
  ASSERT_TRUE(store_->Requeue(attempt, true, false).ok());
  EXPECT_EQ(store_->Get(first.job_id)->state, JobState::kCancelled);

  const PlanningJob second = Create();
  Claim();
  ASSERT_TRUE(store_->RequestCancel(second.job_id).ok());
  Reopen();
  EXPECT_EQ(*store_->RequeueOrphans(), 0);
  EXPECT_EQ(store_->Get(second.job_id)->state, JobState::kCancelled);
  EXPECT_THAT(EventTypes(second.job_id), ElementsAre("accepted", "cancelled"));
}

TEST_P(JobStoreTest, ProgressNeverGoesBack) {
  Create();
  const Attempt attempt = AttemptOf(Claim());
  const auto progress_after = [&](double progress) {
    EXPECT_TRUE(store_->ReportProgress(attempt, progress, "m").ok());
    return store_->Get(attempt.job_id)->progress;
  };
  EXPECT_EQ(progress_after(0.5), 0.5);
  EXPECT_EQ(progress_after(0.25), 0.5);
  EXPECT_EQ(progress_after(-std::numeric_limits<double>::infinity()), 0.5);
  EXPECT_EQ(progress_after(std::nan("")), 0.5);
  EXPECT_EQ(progress_after(0.1 + 0.2 + 0.3), 0.1 + 0.2 + 0.3);  // every bit of it
  EXPECT_EQ(progress_after(7), 1);
}

TEST_P(JobStoreTest, ProgressEventsAreASecondApart) {
  Create();
  Create();
  const Attempt attempt = AttemptOf(Claim());
  const Attempt other = AttemptOf(Claim());
  const auto report = [&](const Attempt& of, double progress) {
    EXPECT_TRUE(store_->ReportProgress(of, progress, "m").ok());
  };
  report(attempt, 0.1);
  report(attempt, 0.2);
  now_ += std::chrono::milliseconds(999);
  report(attempt, 0.3);
  report(other, 0.3);  // has a second of its own
  EXPECT_THAT(EventTypes(attempt.job_id), ElementsAre("accepted", "progress"));
  EXPECT_THAT(EventTypes(other.job_id), ElementsAre("accepted", "progress"));
  now_ += std::chrono::milliseconds(1);
  report(attempt, 0.4);
  report(attempt, 0.5);
  ASSERT_TRUE(store_->Succeed(attempt, {}).ok());
  EXPECT_THAT(EventTypes(attempt.job_id), ElementsAre("accepted", "progress", "progress", "done"));
  EXPECT_EQ((*store_->Events(0, attempt.job_id, 10))[2].job.progress, 0.4);
}

TEST_P(JobStoreTest, RepeatedProgressChangesNothing) {
  Create();
  const Attempt attempt = AttemptOf(Claim());
  ASSERT_TRUE(store_->ReportProgress(attempt, 0.1, "m").ok());
  const int64_t revision = store_->Get(attempt.job_id)->revision;
  now_ += std::chrono::hours(1);
  ASSERT_TRUE(store_->ReportProgress(attempt, 0.1, "m").ok());
  EXPECT_EQ(store_->Get(attempt.job_id)->revision, revision);
  EXPECT_THAT(EventTypes(attempt.job_id), ElementsAre("accepted", "progress"));
}

TEST_P(JobStoreTest, EventsAreGaplessAndInOrder) {
  ClientQuota none;
  none.max_queued_jobs = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([this, i, &none] {
      for (int k = 0; k < 10; ++k) {
        const std::string client(1, static_cast<char>('a' + i));
        EXPECT_TRUE(store_->Create(NewJob(client), {}).ok());
        EXPECT_FALSE(store_->Create(NewJob(client), none).ok());  // leaves no gap
        const auto job = store_->Claim(NoQuota);
        if (!job.ok() || !*job) continue;
        EXPECT_TRUE(store_->Succeed(AttemptOf(**job), {}).ok());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  const auto events = store_->Events(0, std::nullopt, 1000);
  ASSERT_THAT(*events, SizeIs(80));
  std::map<std::string, int64_t> revisions;
  for (size_t i = 0; i < events->size(); ++i) {
    const JobEvent& event = (*events)[i];
    EXPECT_EQ(event.sequence, static_cast<int64_t>(i + 1));
    EXPECT_GT(event.job.revision, revisions[event.job.job_id]);
    revisions[event.job.job_id] = event.job.revision;
  }
}

TEST_P(JobStoreTest, EventsTellOfTheJobAsItWas) {
  const PlanningJob made = Create("mes");
  const Attempt attempt = AttemptOf(Claim());
  ASSERT_TRUE(store_->ReportProgress(attempt, 0.5, "half").ok());
  ASSERT_TRUE(store_->Succeed(attempt, {}).ok());
  Create("other");
  const auto events = store_->Events(0, std::nullopt, 100);
  ASSERT_THAT(*events, SizeIs(4));
  EXPECT_EQ((*events)[0].job.state, JobState::kQueued);
  EXPECT_EQ((*events)[0].job.client, "mes");
  EXPECT_EQ((*events)[0].job.kind, "plan");
  EXPECT_EQ((*events)[1].job.state, JobState::kRunning);
  EXPECT_EQ((*events)[1].job.progress, 0.5);
  EXPECT_EQ((*events)[1].job.message, "half");
  EXPECT_EQ((*events)[2].job.state, JobState::kSucceeded);
  EXPECT_EQ((*events)[3].job.client, "other");

  EXPECT_THAT(*store_->Events(1, made.job_id, 100), SizeIs(2));
  EXPECT_THAT(*store_->Events(1, std::nullopt, 2), SizeIs(2));
  EXPECT_THAT(*store_->Events(4, std::nullopt, 2), IsEmpty());
  EXPECT_THAT(*store_->Events(0, "job-0", 2), IsEmpty());
}

TEST_P(JobStoreTest, EventCursorsAreKept) {
  EXPECT_EQ(*store_->EventCursor("mqtt"), 0);
  ASSERT_TRUE(store_->SetEventCursor("mqtt", 5).ok());
  EXPECT_EQ(*store_->EventCursor("mqtt"), 5);
  EXPECT_EQ(*store_->EventCursor("webhook"), 0);
  ASSERT_TRUE(store_->SetEventCursor("mqtt", 3).ok());
  EXPECT_EQ(*store_->EventCursor("mqtt"), 5);
  Reopen();
  EXPECT_EQ(*store_->EventCursor("mqtt"), 5);
  EXPECT_TRUE(store_->HoldsReceiver("mqtt"));
  EXPECT_TRUE(store_->HoldsReceiver("mqtt"));
}

TEST_P(JobStoreTest, ListsByFilterAndPage) {
  std::vector<std::string> ids;
  for (int i = 0; i < 5; ++i) {
    NewPlanningJob asked = NewJob(i % 2 == 0 ? "even" : "odd");
    asked.kind = i < 3 ? "plan" : "render";
    asked.files = {File("part.stl", 'a', 1)};
    ids.push_back(store_->Create(asked, {})->job_id);
  }
  ASSERT_TRUE(store_->Succeed({Claim().job_id, 1}, {File("r", 'b', 2), File("s", 'c', 3)}).ok());
  const auto list = [&](const PlanningJobFilter& filter) {
    std::vector<std::string> found;
    const auto jobs = store_->List(filter);
    EXPECT_TRUE(jobs.ok()) << jobs.status();
    for (const PlanningJob& job : jobs.value_or(std::vector<PlanningJob>())) {
      found.push_back(job.job_id);
    }
    return found;
  };
  EXPECT_THAT(list({}), ElementsAre(ids[4], ids[3], ids[2], ids[1], ids[0]));
  EXPECT_THAT(list(JobsOfClient("odd")), ElementsAre(ids[3], ids[1]));
  EXPECT_THAT(list(JobsOfClient("nobody")), IsEmpty());
  EXPECT_THAT(list(JobsOfKinds({"render", "optics"})), ElementsAre(ids[4], ids[3]));
  EXPECT_THAT(list(JobsInState(JobState::kSucceeded)), ElementsAre(ids[0]));
  PlanningJobFilter several = JobsOfClient("even");
  several.states = {JobState::kQueued};
  several.kinds = {"plan"};
  EXPECT_THAT(list(several), ElementsAre(ids[2]));

  std::vector<std::string> paged;
  PlanningJobFilter page = AllJobs(2);
  for (int i = 0; i < 4; ++i) {
    const auto jobs = store_->List(page);
    for (const PlanningJob& job : *jobs) {
      paged.push_back(job.job_id);
      page.before_sequence = job.sequence;
    }
    if (i == 0) Create("later");  // is newer than any page
  }
  EXPECT_THAT(paged, ElementsAre(ids[4], ids[3], ids[2], ids[1], ids[0]));

  const auto all = store_->List({});
  EXPECT_THAT(all->back().results, ElementsAre(File("r", 'b', 2), File("s", 'c', 3)));
  EXPECT_THAT(all->back().task, IsEmpty());
  EXPECT_THAT(all->back().files, IsEmpty());
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->List(JobsOfKinds(std::vector<std::string>(101, "plan"))).status()));
}

TEST_P(JobStoreTest, Recipes) {
  const Recipe recipe = {
      "mes", "R1", "plan", "f1", std::string("t\0\xff", 3), {File("part.stl", 'a', 10)}};
  const absl::Status unknown = store_->GetRecipe("mes", "R1").status();
  EXPECT_TRUE(absl::IsNotFound(unknown));
  EXPECT_EQ(ErrorReason(unknown), "RECIPE_UNKNOWN");
  ASSERT_TRUE(store_->PutRecipe(recipe, {}).ok());
  Reopen();
  const auto kept = store_->GetRecipe("mes", "R1");
  ASSERT_TRUE(kept.ok()) << kept.status();
  EXPECT_EQ(kept->kind, "plan");
  EXPECT_EQ(kept->fingerprint, "f1");
  EXPECT_EQ(kept->task, recipe.task);
  EXPECT_EQ(kept->files, recipe.files);
  EXPECT_TRUE(absl::IsNotFound(store_->GetRecipe("other", "R1").status()));

  // The same name again replaces it, files too; another client's stays.
  ASSERT_TRUE(store_->PutRecipe({"other", "R1", "plan", "f3", "o", {File("o", 'c', 1)}}, {}).ok());
  ASSERT_TRUE(store_->PutRecipe({"mes", "R1", "optics", "f2", "u", {File("p", 'b', 5)}}, {}).ok());
  EXPECT_EQ(store_->GetRecipe("mes", "R1")->kind, "optics");
  EXPECT_THAT(store_->GetRecipe("mes", "R1")->files, ElementsAre(File("p", 'b', 5)));
  EXPECT_EQ(store_->Count("mes")->stored_bytes, 5);
  EXPECT_EQ(*store_->CountRecipes("mes"), 1);

  ASSERT_TRUE(store_->DeleteRecipe("mes", "R1").ok());
  ASSERT_TRUE(store_->DeleteRecipe("mes", "R1").ok());
  EXPECT_EQ(*store_->CountRecipes("mes"), 0);
  EXPECT_EQ(store_->Count("mes")->stored_bytes, 0);
  EXPECT_THAT(store_->GetRecipe("other", "R1")->files, ElementsAre(File("o", 'c', 1)));
}

TEST_P(JobStoreTest, FindsFilesThatTheClientHolds) {
  ASSERT_TRUE(store_->AddUpload("mes", File("", 'a', 10), {}).ok());
  ASSERT_TRUE(store_->PutRecipe({"mes", "R", "plan", "f", "t", {File("p", 'b', 20)}}, {}).ok());
  NewPlanningJob asked = NewJob();
  asked.files = {File("p", 'c', 30)};
  ASSERT_TRUE(store_->Create(asked, {}).ok());
  ASSERT_TRUE(store_->Succeed(AttemptOf(Claim()), {File("r", 'd', 40)}).ok());
  const auto size = [&](const std::string& client, char digest) {
    return (*store_->FindFile(client, std::string(64, digest))).value_or(-1);
  };
  EXPECT_EQ(size("mes", 'a'), 10);
  EXPECT_EQ(size("mes", 'b'), 20);
  EXPECT_EQ(size("mes", 'c'), 30);
  EXPECT_EQ(size("mes", 'd'), 40);
  EXPECT_EQ(size("mes", 'e'), -1);
  EXPECT_EQ(size("other", 'a'), -1);
  EXPECT_THAT(*store_->NamedDigests(),
              UnorderedElementsAre(std::string(64, 'a'), std::string(64, 'b'), std::string(64, 'c'),
                                   std::string(64, 'd')));
}

TEST_P(JobStoreTest, RetentionCountsServiceTime) {
  NewPlanningJob asked = NewJob();
  asked.request_id = "order-1";
  asked.files = {File("part.stl", 'a', 10)};
  ASSERT_TRUE(store_->AddUpload("mes", File("", 'a', 10), {}).ok());
  ASSERT_TRUE(store_->AddUpload("mes", File("", 'b', 10), {}).ok());
  const PlanningJob old = *store_->Create(asked, {});
  ASSERT_TRUE(store_->Succeed(AttemptOf(Claim()), {File("r", 'c', 1)}).ok());
  const PlanningJob running = Create();
  Claim();
  const PlanningJob queued = Create();

  // However long ago the clock of the wall says it was made.
  EXPECT_EQ(*store_->RemoveOlderThan(absl::ZeroDuration()), 0);
  ASSERT_TRUE(store_->AdvanceServiceTime(absl::Hours(2)).ok());
  Reopen();  // service time is kept
  ASSERT_TRUE(store_->RequeueOrphans().ok());
  EXPECT_EQ(*store_->RemoveOlderThan(absl::Hours(2)), 0);
  EXPECT_THAT(*store_->NamedDigests(), SizeIs(3));
  EXPECT_EQ(*store_->RemoveOlderThan(absl::Hours(2) - absl::Microseconds(1)), 1);

  EXPECT_TRUE(absl::IsNotFound(store_->Get(old.job_id).status()));
  EXPECT_TRUE(store_->Get(running.job_id).ok());
  EXPECT_TRUE(store_->Get(queued.job_id).ok());
  EXPECT_THAT(*store_->NamedDigests(), IsEmpty());
  EXPECT_EQ(store_->Count("mes")->stored_bytes, 0);
  EXPECT_THAT(*store_->Events(0, std::nullopt, 100), IsEmpty());
  // Its request is forgotten with it, and numbers go on.
  const auto again = store_->Create(asked, {});
  EXPECT_NE(again->job_id, old.job_id);
  EXPECT_EQ(again->sequence, 4);
  EXPECT_EQ((*store_->Events(0, again->job_id, 1))[0].sequence, 5);
}

TEST_P(JobStoreTest, RetentionKeepsUploadsInUse) {
  ASSERT_TRUE(store_->AddUpload("mes", File("", 'a', 1), {}).ok());
  ASSERT_TRUE(store_->AddUpload("mes", File("", 'b', 1), {}).ok());
  ASSERT_TRUE(store_->AddUpload("other", File("", 'b', 1), {}).ok());
  ASSERT_TRUE(store_->AddUpload("mes", File("", 'c', 1), {}).ok());
  ASSERT_TRUE(store_->PutRecipe({"mes", "R", "plan", "f", "t", {File("p", 'a', 1)}}, {}).ok());
  ASSERT_TRUE(store_->AdvanceServiceTime(absl::Hours(2)).ok());
  ASSERT_TRUE(store_->AddUpload("mes", File("", 'b', 1), {}).ok());  // again: is new
  EXPECT_EQ(*store_->RemoveOlderThan(absl::Hours(1)), 0);
  EXPECT_THAT(*store_->NamedDigests(),
              UnorderedElementsAre(std::string(64, 'a'), std::string(64, 'b')));
  EXPECT_EQ(*store_->FindFile("other", std::string(64, 'b')), std::nullopt);
  EXPECT_EQ(*store_->FindFile("mes", std::string(64, 'a')), 1);
}

TEST_P(JobStoreTest, EventsWaitForTheirReceivers) {
  Create();
  ASSERT_TRUE(store_->Succeed(AttemptOf(Claim()), {File("r", 'a', 1)}).ok());
  EXPECT_EQ(*store_->EventCursor("mqtt"), 0);
  ASSERT_TRUE(store_->SetEventCursor("webhook", 2).ok());
  ASSERT_TRUE(store_->AdvanceServiceTime(absl::Hours(2)).ok());
  EXPECT_EQ(*store_->RemoveOlderThan(absl::Hours(1)), 1);
  auto events = store_->Events(0, std::nullopt, 10);
  ASSERT_THAT(*events, SizeIs(2));
  // The job has gone, its events have not.
  EXPECT_THAT((*events)[1].job.results, ElementsAre(File("r", 'a', 1)));
  ASSERT_TRUE(store_->SetEventCursor("mqtt", 1).ok());
  EXPECT_EQ(*store_->RemoveOlderThan(absl::Hours(1)), 0);
  EXPECT_THAT(*store_->Events(0, std::nullopt, 10), SizeIs(1));
  ASSERT_TRUE(store_->SetEventCursor("mqtt", 2).ok());
  EXPECT_EQ(*store_->RemoveOlderThan(absl::Hours(1)), 0);
  EXPECT_THAT(*store_->Events(0, std::nullopt, 10), IsEmpty());
}

TEST_P(JobStoreTest, ServiceTimeOnlyAdvances) {
  EXPECT_TRUE(absl::IsInvalidArgument(store_->AdvanceServiceTime(-absl::Seconds(1))));
  EXPECT_TRUE(absl::IsInvalidArgument(store_->AdvanceServiceTime(absl::InfiniteDuration())));
  EXPECT_TRUE(store_->RemoveOlderThan(absl::InfiniteDuration()).ok());
}

// The waits below never end by their timeout: the test would.
TEST_P(JobStoreTest, ChangeEndsWait) {
  const PlanningJob made = Create();
  absl::StatusOr<PlanningJob> seen = absl::UnknownError("");
  std::thread waiter(
      [&] { seen = store_->WaitForChange(made.job_id, made.revision, absl::InfiniteDuration()); });
  Create();  // of another job: wakes nobody for good
  Claim();
  waiter.join();
  ASSERT_TRUE(seen.ok()) << seen.status();
  EXPECT_EQ(seen->state, JobState::kRunning);
  EXPECT_GT(seen->revision, made.revision);
}

TEST_P(JobStoreTest, WaitEndsAtOnceOrByTimeout) {
  const PlanningJob made = Create();
  EXPECT_EQ(store_->WaitForChange(made.job_id, 0, absl::InfiniteDuration())->revision,
            made.revision);
  EXPECT_EQ(store_->WaitForChange(made.job_id, made.revision, absl::Milliseconds(1))->revision,
            made.revision);
  EXPECT_EQ(store_->WaitForChange(made.job_id, made.revision, -absl::Hours(1))->revision,
            made.revision);
}

TEST_P(JobStoreTest, EventEndsWait) {
  Create();
  store_->WaitForEvent(0, absl::InfiniteDuration());
  store_->WaitForEvent(1, absl::Milliseconds(1));
  std::thread waiter([&] { store_->WaitForEvent(1, absl::InfiniteDuration()); });
  Create();
  waiter.join();
  EXPECT_THAT(*store_->Events(1, std::nullopt, 10), SizeIs(1));
}

TEST_P(JobStoreTest, RefusesNewerTables) {
  store_.reset();
  {
    const auto database = OpenDatabase();
    const auto connection = database->Connect();
    ASSERT_TRUE((*connection)->Begin(SqlAccess::kWrite).ok());
    ASSERT_TRUE((*connection)->Run("UPDATE schema_version SET version = 99", {}).ok());
    ASSERT_TRUE((*connection)->Commit().ok());
  }
  const absl::Status refused = TryOpen().status();
  EXPECT_TRUE(absl::IsFailedPrecondition(refused)) << refused;
  EXPECT_THAT(refused.message(), HasSubstr("version 99"));
  EXPECT_THAT(refused.message(), HasSubstr("version 3"));
}

// Tables that a program of the first version left behind.
TEST_P(JobStoreTest, TakesOverTablesOfVersion1) {
  const PlanningJob running = Create();
  Claim();
  const PlanningJob queued = Create();
  store_.reset();
  {
    const auto database = OpenDatabase();
    const auto connection = database->Connect();
    ASSERT_TRUE((*connection)->Begin(SqlAccess::kWrite).ok());
    ASSERT_TRUE((*connection)->Run("ALTER TABLE job DROP COLUMN traceparent", {}).ok());
    ASSERT_TRUE((*connection)->Run("DROP TABLE database_identity", {}).ok());
    ASSERT_TRUE((*connection)->Run("UPDATE schema_version SET version = 1", {}).ok());
    ASSERT_TRUE((*connection)->Commit().ok());
  }
  Reopen();
  EXPECT_EQ(store_->Get(running.job_id)->state, JobState::kRunning);
  EXPECT_EQ(*store_->RequeueOrphans(), 1);
  EXPECT_EQ(store_->Get(queued.job_id)->traceparent, "");
  NewPlanningJob asked = NewJob();
  asked.traceparent = kTraceparent;
  EXPECT_EQ(store_->Create(asked, {})->traceparent, kTraceparent);
  EXPECT_EQ(Claim().job_id, running.job_id);
}

TEST_P(JobStoreTest, EventIdsGoOnAfterEveryStart) {
  // A new database has given no ids that another event could get.
  EXPECT_FALSE(*store_->BeginService());
  EXPECT_EQ(*store_->NewestEvent(), 0);
  Create();
  const int64_t first = *store_->NewestEvent();
  EXPECT_TRUE(*store_->HasEvent(first));
  EXPECT_FALSE(*store_->HasEvent(first + 1));
  EXPECT_FALSE(*Reopen().BeginService());
  Create();
  EXPECT_EQ(*store_->NewestEvent(), first + 1);
}

// A restored dump is a database whose tables live elsewhere.
TEST_P(JobStoreTest, EventIdsOfARestoredDatabaseWereNeverGiven) {
  ASSERT_TRUE(store_->BeginService().ok());
  Create();
  const int64_t given = *store_->NewestEvent();
  Change("UPDATE database_identity SET instance = 'elsewhere'");
  EXPECT_TRUE(*store_->BeginService());
  EXPECT_FALSE(*store_->BeginService());
  Create();
  EXPECT_GT(*store_->NewestEvent(), given + (int64_t{1} << 32));
}

// A backup may be restored again and again: no two of its services give the same id.
TEST_P(JobStoreTest, EventIdsOfTwoRestoredCopiesDiffer) {
  ASSERT_TRUE(store_->BeginService().ok());
  for (const bool has_events : {false, true}) {
    if (has_events) Create();
    const int64_t of_backup = *store_->NewestEvent();
    int64_t given = 0;
    for (int restore = 0; restore < 3; ++restore) {
      Change(absl::StrCat("UPDATE counter SET value = ", of_backup, " WHERE name = 'event'"));
      Change("UPDATE database_identity SET instance = 'elsewhere'");
      EXPECT_TRUE(*store_->BeginService());
      Create();
      EXPECT_GT(*store_->NewestEvent(), given);
      given = *store_->NewestEvent();
      EXPECT_LT(given, int64_t{1} << 53);
      absl::SleepFor(absl::Milliseconds(5));
    }
  }
}

}  // namespace
}  // namespace sightline
