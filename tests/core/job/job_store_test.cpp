// SPDX-License-Identifier: Apache-2.0
#include "core/job/job_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <new>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

namespace sightline {
namespace {

using ::testing::HasSubstr;

// A door that work waits at, so that tests decide when it goes on.
class Gate {
 public:
  void Open() {
    std::lock_guard lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }
  void Pass() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return open_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool open_ = false;
};

JobWork Returns(const std::string& key) {
  return [key](JobContext&) -> absl::StatusOr<std::string> { return key; };
}

JobWork WaitsUntilCancelled() {
  return [](JobContext& context) -> absl::StatusOr<std::string> {
    while (!context.cancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return absl::CancelledError("stopped");
  };
}

JobRecord WaitUntil(const JobStore& store, const std::string& id, auto condition) {
  JobRecord job = *store.Get(id);
  while (!condition(job)) job = *store.WaitForChange(id, job.revision, absl::InfiniteDuration());
  return job;
}

JobRecord WaitUntilFinished(const JobStore& store, const std::string& id) {
  return WaitUntil(store, id, [](const JobRecord& job) { return job.finished(); });
}

JobRecord WaitUntilRunning(const JobStore& store, const std::string& id) {
  return WaitUntil(store, id, [](const JobRecord& job) { return job.state != JobState::kQueued; });
}

TEST(JobStore, RunsAJobAndKeepsItsResult) {
  const auto store = MakeInMemoryJobStore(1);
  const JobRecord created = *store->Create("scene", "", "f", Returns("digest"));
  EXPECT_FALSE(created.job_id.empty());
  EXPECT_EQ(created.kind, "scene");
  const JobRecord done = WaitUntilFinished(*store, created.job_id);
  EXPECT_EQ(done.state, JobState::kSucceeded);
  EXPECT_EQ(done.result_key, "digest");
  EXPECT_EQ(done.progress, 1);
  EXPECT_TRUE(done.error.ok());
  EXPECT_GT(done.revision, created.revision);
}

TEST(JobStore, FailureKeepsTheError) {
  const auto store = MakeInMemoryJobStore(1);
  const JobRecord created = *store->Create(
      "scene", "", "",
      [](JobContext&) -> absl::StatusOr<std::string> { return absl::DataLossError("torn"); });
  const JobRecord done = WaitUntilFinished(*store, created.job_id);
  EXPECT_EQ(done.state, JobState::kFailed);
  EXPECT_EQ(done.error, absl::DataLossError("torn"));
}

TEST(JobStore, ExceptionIsAFailureAndTheWorkerGoesOn) {
  const auto store = MakeInMemoryJobStore(1);
  const JobRecord thrown = *store->Create(
      "scene", "", "",
      [](JobContext&) -> absl::StatusOr<std::string> { throw std::runtime_error("bang"); });
  const JobRecord next = *store->Create("scene", "", "", Returns("fine"));
  const JobRecord failed = WaitUntilFinished(*store, thrown.job_id);
  EXPECT_EQ(failed.state, JobState::kFailed);
  EXPECT_NE(failed.error.message().find("bang"), absl::string_view::npos);
  EXPECT_EQ(WaitUntilFinished(*store, next.job_id).state, JobState::kSucceeded);
}

TEST(JobStore, SameRequestIsTheSameJob) {
  const auto store = MakeInMemoryJobStore(2);
  std::atomic<int> runs{0};
  const JobWork work = [&](JobContext&) -> absl::StatusOr<std::string> {
    ++runs;
    return "key";
  };
  const JobRecord first = *store->Create("scene", "r1", "print", work);
  EXPECT_EQ(store->Create("scene", "r1", "print", work)->job_id, first.job_id);
  WaitUntilFinished(*store, first.job_id);
  // After it has finished too.
  const JobRecord again = *store->Create("scene", "r1", "print", work);
  EXPECT_EQ(again.job_id, first.job_id);
  EXPECT_EQ(again.state, JobState::kSucceeded);
  EXPECT_EQ(again.result_key, "key");
  // Same id with something else is an error; for another kind it is another request.
  EXPECT_EQ(store->Create("scene", "r1", "other print", work).status().code(),
            absl::StatusCode::kAlreadyExists);
  const JobRecord plan = *store->Create("plan", "r1", "print", work);
  EXPECT_NE(plan.job_id, first.job_id);
  WaitUntilFinished(*store, plan.job_id);
  EXPECT_EQ(runs, 2);
}

TEST(JobStore, NoRequestIdIsAlwaysANewJob) {
  const auto store = MakeInMemoryJobStore(1);
  EXPECT_NE(store->Create("scene", "", "same", Returns(""))->job_id,
            store->Create("scene", "", "same", Returns(""))->job_id);
}

TEST(JobStore, ConcurrentCreatesOfOneRequestMakeOneJob) {
  const auto store = MakeInMemoryJobStore(2);
  std::atomic<int> runs{0};
  std::vector<std::string> ids(8);
  std::vector<std::thread> threads;
  for (std::string& id : ids) {
    threads.emplace_back([&store, &runs, &id] {
      id = store
               ->Create("scene", "r", "f",
                        [&runs](JobContext&) -> absl::StatusOr<std::string> {
                          ++runs;
                          return "";
                        })
               ->job_id;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(std::set<std::string>(ids.begin(), ids.end()).size(), 1u);
  WaitUntilFinished(*store, ids[0]);
  EXPECT_EQ(runs, 1);
}

TEST(JobStore, UnknownJobIsNotFound) {
  const auto store = MakeInMemoryJobStore(1);
  EXPECT_EQ(store->Get("nothing").status().code(), absl::StatusCode::kNotFound);
  // A terminal would obey what somebody named.
  EXPECT_EQ(store->Get("\x1b[31m").status().message(), "no job \"\\x1b[31m\"");
  EXPECT_EQ(store->Cancel("nothing").status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store->WaitForChange("nothing", 0, absl::Seconds(1)).status().code(),
            absl::StatusCode::kNotFound);
}

TEST(JobStore, CancelOfAQueuedJobKeepsItFromRunning) {
  Gate gate;
  const auto store = MakeInMemoryJobStore(1);
  const JobRecord busy = *store->Create("a", "", "", [&](JobContext&) {
    gate.Pass();
    return absl::StatusOr<std::string>("");
  });
  WaitUntilRunning(*store, busy.job_id);
  std::atomic<bool> ran{false};
  const JobRecord queued = *store->Create("a", "", "", [&](JobContext&) {
    ran = true;
    return absl::StatusOr<std::string>("");
  });
  EXPECT_EQ(store->Cancel(queued.job_id)->state, JobState::kCancelled);
  gate.Open();
  WaitUntilFinished(*store, busy.job_id);
  const JobRecord last = *store->Create("a", "", "", Returns(""));
  WaitUntilFinished(*store, last.job_id);
  EXPECT_FALSE(ran);
  EXPECT_EQ(store->Get(queued.job_id)->error.code(), absl::StatusCode::kCancelled);
}

TEST(JobStore, ACancelledJobMayLeaveWhatItHas) {
  const auto store = MakeInMemoryJobStore(1);
  std::atomic<bool> started = false;
  const JobRecord job = *store->Create("a", "", "", [&](JobContext& context) {
    started = true;
    while (!context.cancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return absl::StatusOr<std::string>("so far");
  });
  while (!started) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ASSERT_TRUE(store->Cancel(job.job_id).ok());
  JobRecord done = *store->Get(job.job_id);
  while (!done.finished()) {
    done = *store->WaitForChange(job.job_id, done.revision, absl::InfiniteDuration());
  }
  EXPECT_EQ(done.state, JobState::kCancelled);
  EXPECT_EQ(done.error.code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(done.result_key, "so far");
}

TEST(JobStore, CancelStopsARunningJobSoon) {
  const auto store = MakeInMemoryJobStore(1);
  const JobRecord job = *store->Create("a", "", "", WaitsUntilCancelled());
  WaitUntilRunning(*store, job.job_id);
  ASSERT_TRUE(store->Cancel(job.job_id).ok());
  const JobRecord done = WaitUntilFinished(*store, job.job_id);
  EXPECT_EQ(done.state, JobState::kCancelled);
  EXPECT_EQ(done.error.code(), absl::StatusCode::kCancelled);
  // Once more changes nothing.
  const JobRecord again = *store->Cancel(job.job_id);
  EXPECT_EQ(again.revision, done.revision);
  EXPECT_EQ(again.state, JobState::kCancelled);
}

TEST(JobStore, CancelOfAFinishedJobLeavesItAsItIs) {
  const auto store = MakeInMemoryJobStore(1);
  const JobRecord job = *store->Create("a", "", "", Returns("key"));
  const JobRecord done = WaitUntilFinished(*store, job.job_id);
  EXPECT_EQ(store->Cancel(job.job_id)->state, JobState::kSucceeded);
  EXPECT_EQ(store->Get(job.job_id)->revision, done.revision);
}

TEST(JobStore, WaitForChangeSeesEveryStepAndTimesOut) {
  Gate first, second;
  const auto store = MakeInMemoryJobStore(1);
  const JobRecord job = *store->Create("a", "", "", [&](JobContext& context) {
    context.ReportProgress(0.25, "a quarter");
    first.Pass();
    context.ReportProgress(0.5, "half");
    second.Pass();
    return absl::StatusOr<std::string>("");
  });
  const auto at = [](const std::string& message) {
    return [message](const JobRecord& record) { return record.message == message; };
  };
  const JobRecord quarter = WaitUntil(*store, job.job_id, at("a quarter"));
  EXPECT_EQ(quarter.progress, 0.25);
  EXPECT_EQ(quarter.state, JobState::kRunning);
  // Nothing happens: the wait ends with what is known.
  const JobRecord same =
      *store->WaitForChange(job.job_id, quarter.revision, absl::Milliseconds(20));
  EXPECT_EQ(same.revision, quarter.revision);
  // A caller that is behind gets the news without waiting.
  EXPECT_EQ(store->WaitForChange(job.job_id, 0, absl::InfiniteDuration())->revision,
            quarter.revision);
  first.Open();
  EXPECT_EQ(store->WaitForChange(job.job_id, quarter.revision, absl::InfiniteDuration())->message,
            "half");
  second.Open();
  WaitUntilFinished(*store, job.job_id);
}

TEST(JobStore, ProgressNeverGoesBackAndStaysInRange) {
  Gate gate;
  const auto store = MakeInMemoryJobStore(1);
  const JobRecord job = *store->Create("a", "", "", [&](JobContext& context) {
    context.ReportProgress(0.7, "");
    context.ReportProgress(0.2, "");
    context.ReportProgress(std::nan(""), "");
    context.ReportProgress(7, "here");
    gate.Pass();
    return absl::StatusOr<std::string>(absl::UnknownError("fails"));
  });
  const JobRecord last = WaitUntil(
      *store, job.job_id, [](const JobRecord& record) { return record.message == "here"; });
  EXPECT_EQ(last.progress, 1);
  gate.Open();
  WaitUntilFinished(*store, job.job_id);
}

TEST(JobStore, ListsInOrderOfCreationByKind) {
  const auto store = MakeInMemoryJobStore(3);
  std::vector<std::string> scenes, all;
  for (int i = 0; i < 20; ++i) {
    const JobRecord job = *store->Create(i % 2 ? "plan" : "scene", "", "", Returns(""));
    all.push_back(job.job_id);
    if (i % 2 == 0) scenes.push_back(job.job_id);
  }
  const auto ids = [](const std::vector<JobRecord>& records) {
    std::vector<std::string> list;
    for (const JobRecord& record : records) list.push_back(record.job_id);
    return list;
  };
  EXPECT_EQ(ids(store->List("")), all);
  EXPECT_EQ(ids(store->List("scene")), scenes);
  EXPECT_TRUE(store->List("render").empty());
}

TEST(JobStore, RunsAsManyAtATimeAsThereAreWorkers) {
  for (int workers : {1, 3}) {
    const auto store = MakeInMemoryJobStore(workers);
    std::atomic<int> running{0}, most{0};
    std::string last;
    for (int i = 0; i < 12; ++i) {
      last = store
                 ->Create("a", "", "",
                          [&](JobContext&) -> absl::StatusOr<std::string> {
                            const int now = ++running;
                            int seen = most;
                            while (now > seen && !most.compare_exchange_weak(seen, now)) {
                            }
                            // All workers are at work before the first job ends.
                            while (most < workers) std::this_thread::yield();
                            std::this_thread::sleep_for(std::chrono::milliseconds(10));
                            --running;
                            return "";
                          })
                 ->job_id;
    }
    for (const JobRecord& job : store->List("")) WaitUntilFinished(*store, job.job_id);
    EXPECT_EQ(most, workers);
  }
}

TEST(JobStore, ForgetsTheOldestFinishedJobsButNoOthers) {
  Gate gate;
  const auto store = MakeInMemoryJobStore(2);
  const JobRecord busy = *store->Create("a", "busy", "", [&](JobContext&) {
    gate.Pass();
    return absl::StatusOr<std::string>("");
  });
  WaitUntilRunning(*store, busy.job_id);
  const JobRecord oldest = *store->Create("a", "oldest", "", Returns(""));
  std::string last;
  for (int i = 0; i < 1000; ++i) last = store->Create("a", "", "", Returns(""))->job_id;
  WaitUntilFinished(*store, last);
  EXPECT_EQ(store->Get(oldest.job_id).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store->Get(busy.job_id)->state, JobState::kRunning);
  EXPECT_EQ(store->List("").size(), 1001u);
  // A forgotten request is a new one.
  EXPECT_NE(store->Create("a", "oldest", "", Returns(""))->job_id, oldest.job_id);
  gate.Open();
}

TEST(JobStore, DestructorCancelsWhatRunsAndWhatWaits) {
  std::atomic<bool> stopped{false}, queued_ran{false};
  {
    const auto store = MakeInMemoryJobStore(1);
    const JobRecord running =
        *store->Create("a", "", "", [&](JobContext& context) -> absl::StatusOr<std::string> {
          while (!context.cancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
          stopped = true;
          return absl::CancelledError("");
        });
    WaitUntilRunning(*store, running.job_id);
    ASSERT_TRUE(store
                    ->Create("a", "", "",
                             [&](JobContext&) -> absl::StatusOr<std::string> {
                               queued_ran = true;
                               return "";
                             })
                    .ok());
  }
  EXPECT_TRUE(stopped);
  EXPECT_FALSE(queued_ran);
}

TEST(JobStore, DestructorReleasesWhoeverWaits) {
  auto store = MakeInMemoryJobStore(1);
  const JobRecord job = *store->Create("a", "", "", WaitsUntilCancelled());
  const JobRecord running = WaitUntilRunning(*store, job.job_id);
  std::atomic<bool> about_to_wait{false};
  const JobStore* const view = store.get();
  std::thread waiter([&, view] {
    about_to_wait = true;
    // Sees the cancellation, or is released by the destructor: it does not hang.
    EXPECT_TRUE(view->WaitForChange(job.job_id, running.revision, absl::InfiniteDuration()).ok());
  });
  while (!about_to_wait) std::this_thread::yield();
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  store.reset();
  waiter.join();
}

TEST(JobStore, HasRoomForNoMoreUnfinishedJobsThanItMay) {
  const auto store = MakeInMemoryJobStore(
      1, {.max_jobs = 4, .max_jobs_of_owner = 2, .max_bytes = 100, .max_bytes_of_owner = 80});
  const auto reserve = [&](const std::string& owner, int64_t bytes) {
    return store->Reserve(owner, [bytes] { return bytes; });
  };
  const auto expect_full = [&](const std::string& owner, int64_t bytes, const char* reason) {
    const absl::Status status = reserve(owner, bytes).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(reason));
  };
  const JobRecord first = *store->Create("a", "one", "", WaitsUntilCancelled(), *reserve("me", 40));
  const JobRecord second = *store->Create("a", "", "", Returns(""), *reserve("me", 30));
  expect_full("me", 0, "for me: 2 of its jobs wait or run, at most 2 may");
  expect_full("you", 31,
              ": the jobs that wait or run hold 70 bytes, this one 31 more, at most 100");
  // Refused jobs take no place; what is being made does.
  auto third = *reserve("you", 20);
  expect_full("you", 11, "hold 90 bytes, this one 11 more");
  const auto fourth = *reserve("nobody", 0);
  const auto fifth = store->Reserve("another", []() -> int64_t {
    ADD_FAILURE() << "this takes time";
    return 1;
  });
  EXPECT_EQ(fifth.status().code(), absl::StatusCode::kResourceExhausted) << fifth.status();
  // A known request is no new job: what it would have taken is free.
  EXPECT_EQ(store->Create("a", "one", "", Returns(""), std::move(third))->job_id, first.job_id);
  EXPECT_TRUE(reserve("you", 20).ok());
  // A job gives back what it has when it is finished, in whatever way.
  ASSERT_TRUE(store->Cancel(second.job_id).ok());
  EXPECT_TRUE(reserve("me", 40).ok());
  expect_full("me", 41, "for me: its jobs that wait or run hold 40 bytes");
  ASSERT_TRUE(store->Cancel(first.job_id).ok());
  WaitUntilFinished(*store, first.job_id);
  // One that is too large for the limit is taken alone.
  const auto large = store->Create("a", "", "", Returns("done"), *reserve("me", 1000));
  ASSERT_TRUE(large.ok()) << large.status();
  EXPECT_EQ(WaitUntilFinished(*store, large->job_id).result_key, "done");
}

TEST(JobStore, FindsTheJobOfTheSameRequest) {
  const auto store = MakeInMemoryJobStore(1);
  const auto of = [](const char* text) { return [text] { return std::string(text); }; };
  const auto made = store->Create("render", "id", "spec", Returns("done"));
  ASSERT_TRUE(made.ok()) << made.status();
  const auto known = store->Find("render", "id", of("spec"));
  ASSERT_TRUE(known.ok() && known->has_value()) << known.status();
  EXPECT_EQ((*known)->job_id, made->job_id);
  EXPECT_TRUE(absl::IsAlreadyExists(store->Find("render", "id", of("another")).status()));
  for (const auto& [kind, id] :
       {std::pair("render", ""), std::pair("render", "another"), std::pair("optics", "id")}) {
    const auto unknown = store->Find(kind, id, []() -> std::string {
      ADD_FAILURE() << "this takes time";
      return "";
    });
    ASSERT_TRUE(unknown.ok()) << unknown.status();
    EXPECT_FALSE(unknown->has_value()) << kind << id;
  }
}

TEST(JobStore, LackOfMemoryIsToldFromMistakes) {
  const auto store = MakeInMemoryJobStore(1);
  const JobRecord job = *store->Create(
      "a", "", "", [](JobContext&) -> absl::StatusOr<std::string> { throw std::bad_alloc(); });
  EXPECT_EQ(WaitUntilFinished(*store, job.job_id).error.code(),
            absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace sightline
