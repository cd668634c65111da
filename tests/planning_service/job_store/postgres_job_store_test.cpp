// SPDX-License-Identifier: Apache-2.0
// Tests peculiar to a database that several processes share.
#include <map>
#include <mutex>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "planning_service/job_store/planning_job_store.h"
#include "planning_service/job_store/postgres_database.h"
#include "proto/status/rpc_status.h"
#include "tests/limits/wait_until.h"
#include "tests/planning_service/job_store/postgres_fixture.h"
#include "tests/planning_service/job_store/store_fixture.h"

namespace sightline {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class PostgresJobStoreTest : public testing::Test {
 protected:
  std::unique_ptr<PlanningJobStore> Open(const std::string& application_name = "test") {
    auto store =
        OpenPostgresJobStore(absl::StrCat(database_, " application_name=", application_name));
    EXPECT_TRUE(store.ok()) << store.status();
    return store.ok() ? *std::move(store) : nullptr;
  }

  PostgresServer& server_ = PostgresServer::Get();
  const std::string database_ = server_.NewDatabase();
};

TEST_F(PostgresJobStoreTest, TellsWhyItCannotConnect) {
  const absl::Status nobody = OpenPostgresJobStore("host=/nowhere dbname=x").status();
  EXPECT_TRUE(absl::IsUnavailable(nobody)) << nobody;
  EXPECT_THAT(nobody.message(), HasSubstr("/nowhere"));
  EXPECT_TRUE(absl::IsUnavailable(OpenPostgresJobStore("no=such option").status()));
  const std::string latin =
      server_.NewDatabase("TEMPLATE template0 ENCODING 'LATIN1' LC_COLLATE 'C' LC_CTYPE 'C'");
  const absl::Status encoding = OpenPostgresJobStore(latin).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(encoding)) << encoding;
  EXPECT_THAT(encoding.message(), HasSubstr("LATIN1"));
}

// Needs no server: messages about a connection reach clients and logs.
TEST(PostgresConnectionText, ItsPasswordIsInNoMessage) {
  for (const char* text : {
           "host=/nowhere dbname=jobs user=plan password=s3cret",
           "postgresql://plan:s3cret@127.0.0.1:1/jobs",
           "postgresql://plan:s3cret@127.0.0.1:port/jobs",
           "postgresql://plan:s3cret@[::1/jobs",
           "host=127.0.0.1 port=1 dbname=jobs password='s3cret",
           "host=127.0.0.1 password s3cret",
           "host=127.0.0.1 passwort=s3cret",
       }) {
    const absl::Status status = OpenPostgresJobStore(text).status();
    EXPECT_FALSE(status.ok()) << text;
    EXPECT_THAT(std::string(status.message()), testing::Not(testing::HasSubstr("s3cret"))) << text;
  }
  EXPECT_THAT(
      std::string(OpenPostgresJobStore("host=/nowhere dbname=jobs password=x").status().message()),
      testing::AllOf(testing::HasSubstr("database \"jobs\""), testing::HasSubstr("/nowhere")));
}

TEST_F(PostgresJobStoreTest, StoresThatOpenTogetherMakeTheTablesOnce) {
  std::vector<std::unique_ptr<PlanningJobStore>> stores(4);
  std::vector<std::thread> threads;
  for (auto& store : stores) threads.emplace_back([&] { store = Open(); });
  for (std::thread& thread : threads) thread.join();
  for (const auto& store : stores) {
    ASSERT_NE(store, nullptr);
    EXPECT_TRUE(store->Create(NewJob(), {}).ok());
  }
  EXPECT_THAT(*stores[0]->List({}), SizeIs(4));
}

TEST_F(PostgresJobStoreTest, EveryJobIsClaimedOnce) {
  constexpr int kJobs = 60;
  const auto a = Open();
  const auto b = Open();
  for (int i = 0; i < kJobs; ++i) {
    ASSERT_TRUE((i % 2 == 0 ? a : b)->Create(NewJob(absl::StrCat("c", i % 3)), {}).ok());
  }
  std::mutex mutex;
  std::map<std::string, int> claimed;
  std::vector<std::thread> threads;
  for (PlanningJobStore* store : {a.get(), b.get(), a.get(), b.get()}) {
    threads.emplace_back([&, store] {
      while (true) {
        const auto job = store->Claim(NoQuota);
        ASSERT_TRUE(job.ok()) << job.status();
        if (!*job) return;
        EXPECT_EQ((*job)->attempts, 1);
        ASSERT_TRUE(store->Succeed(AttemptOf(**job), {}).ok());
        std::lock_guard lock(mutex);
        ++claimed[(*job)->job_id];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_THAT(claimed, SizeIs(kJobs));
  for (const auto& [id, times] : claimed) EXPECT_EQ(times, 1) << id;
  const auto events = a->Events(0, std::nullopt, 1000);
  ASSERT_THAT(*events, SizeIs(2 * kJobs));
  for (int i = 0; i < 2 * kJobs; ++i) EXPECT_EQ((*events)[i].sequence, i + 1);
}

TEST_F(PostgresJobStoreTest, AnotherStoresAttemptIsNotOurs) {
  const auto a = Open();
  const auto b = Open();
  ASSERT_TRUE(a->Create(NewJob(), {}).ok());
  const Attempt attempt = AttemptOf(**a->Claim(NoQuota));
  EXPECT_TRUE(absl::IsAborted(b->Succeed(attempt, {})));
  EXPECT_EQ(*b->RequeueOrphans(), 0);
  EXPECT_TRUE(a->Succeed(attempt, {}).ok());
}

TEST_F(PostgresJobStoreTest, ChangesOfOthersEndWaits) {
  const auto a = Open();
  const auto b = Open();
  const auto made = a->Create(NewJob(), {});
  absl::StatusOr<PlanningJob> seen = absl::UnknownError("");
  std::thread job_waiter(
      [&] { seen = a->WaitForChange(made->job_id, made->revision, absl::InfiniteDuration()); });
  std::thread event_waiter([&] { a->WaitForEvent(1, absl::InfiniteDuration()); });
  ASSERT_TRUE(b->RequestCancel(made->job_id).ok());
  job_waiter.join();
  event_waiter.join();
  EXPECT_EQ(seen->state, JobState::kCancelled);
}

TEST_F(PostgresJobStoreTest, CutConnectionsAreOpenedAnew) {
  const auto store = Open("cut");
  const auto made = store->Create(NewJob(), {});
  ASSERT_TRUE(made.ok()) << made.status();
  const Attempt attempt = AttemptOf(**store->Claim(NoQuota));
  EXPECT_EQ(server_.CutConnections("cut"), 3);
  // Nobody else took the job, so it is still ours. Each call finds the connection cut.
  EXPECT_EQ(store->Get(made->job_id)->state, JobState::kRunning);
  const auto cancel = store->ReportProgress(attempt, 0.5, "m");
  ASSERT_TRUE(cancel.ok()) << cancel.status();
  EXPECT_EQ(*store->RequeueOrphans(), 0);
  EXPECT_EQ(server_.CutConnections("cut"), 3);
  EXPECT_TRUE(store->Create(NewJob(), {}).ok());
  EXPECT_EQ(server_.CutConnections("cut"), 1);  // unused connections are not opened
  EXPECT_TRUE(store->Succeed(attempt, {}).ok());
  EXPECT_EQ(store->Get(made->job_id)->state, JobState::kSucceeded);
}

TEST_F(PostgresJobStoreTest, JobGivenToAnotherIsLost) {
  const auto a = Open("first");
  const auto b = Open("second");
  const auto made = a->Create(NewJob(), {});
  const Attempt lost = AttemptOf(**a->Claim(NoQuota));
  EXPECT_EQ(*b->RequeueOrphans(), 0);
  server_.CutConnections("first");
  WaitUntil([&] { return *b->RequeueOrphans() == 1; });
  EXPECT_TRUE(absl::IsAborted(a->ReportProgress(lost, 0.5, "m").status()));
  const auto again = b->Claim(NoQuota);
  ASSERT_TRUE(again.ok() && *again) << again.status();
  EXPECT_EQ((*again)->attempts, 2);
  EXPECT_TRUE(absl::IsAborted(a->Succeed(lost, {})));
  EXPECT_TRUE(b->Succeed(AttemptOf(**again), {}).ok());
  EXPECT_EQ(a->Get(made->job_id)->state, JobState::kSucceeded);
}

TEST_F(PostgresJobStoreTest, OneHoldsAReceiver) {
  auto a = Open("first");
  auto b = Open("second");
  EXPECT_TRUE(a->HoldsReceiver("mqtt"));
  EXPECT_FALSE(b->HoldsReceiver("mqtt"));
  EXPECT_TRUE(b->HoldsReceiver("webhook"));
  EXPECT_TRUE(a->HoldsReceiver("mqtt"));
  server_.CutConnections("first");
  WaitUntil([&] { return b->HoldsReceiver("mqtt"); });
  EXPECT_FALSE(a->HoldsReceiver("mqtt"));
  b.reset();
  WaitUntil([&] { return a->HoldsReceiver("mqtt"); });
}

TEST_F(PostgresJobStoreTest, ServiceTimeRunsOnceHoweverManyServe) {
  const auto a = Open();
  const auto b = Open();
  ASSERT_TRUE(a->Create(NewJob(), {}).ok());
  ASSERT_TRUE(a->Succeed(AttemptOf(**a->Claim(NoQuota)), {}).ok());
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(a->AdvanceServiceTime(absl::Hours(1)).ok());
    ASSERT_TRUE(b->AdvanceServiceTime(absl::Hours(1)).ok());
  }
  EXPECT_EQ(*b->RemoveOlderThan(absl::Hours(10)), 0);
  EXPECT_EQ(*b->RemoveOlderThan(absl::Hours(9)), 1);
}

TEST_F(PostgresJobStoreTest, OutlivesTheServersRestart) {
  const auto store = Open();
  const auto made = store->Create(NewJob(), {});
  const Attempt attempt = AttemptOf(**store->Claim(NoQuota));
  server_.Stop();
  for (const absl::Status& status :
       {store->Get(made->job_id).status(), store->Create(NewJob(), {}).status(),
        store->ReportProgress(attempt, 0.5, "m").status()}) {
    EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  }
  EXPECT_FALSE(store->HoldsReceiver("mqtt"));
  server_.Start();
  WaitUntil([&] { return store->ReportProgress(attempt, 0.5, "m").ok(); });
  WaitUntil([&] { return store->Get(made->job_id).ok(); });
  EXPECT_TRUE(store->Succeed(attempt, {}).ok());
  EXPECT_EQ(store->Get(made->job_id)->state, JobState::kSucceeded);
}

TEST_F(PostgresJobStoreTest, AnswersAreOnDiskWhateverTheServersDefault) {
  server_.Run("ALTER SYSTEM SET synchronous_commit = off");
  server_.Run("SELECT pg_reload_conf()");
  WaitUntil([&] { return server_.Run("SHOW synchronous_commit") == "off"; });
  const auto database = OpenPostgresDatabase(database_);
  ASSERT_TRUE(database.ok()) << database.status();
  const auto connection = (*database)->Connect();
  ASSERT_TRUE(connection.ok()) << connection.status();
  const auto rows = (*connection)->Run("SHOW synchronous_commit", {});
  ASSERT_TRUE(rows.ok()) << rows.status();
  EXPECT_EQ(rows->front().Text(0), "on");
  server_.Run("ALTER SYSTEM RESET synchronous_commit");
  server_.Run("SELECT pg_reload_conf()");
}

TEST_F(PostgresJobStoreTest, GoesOnOnceAFullDiskHasRoom) {
  SmallDisk disk(24 << 20);
  if (!disk.is_mounted()) GTEST_SKIP() << "may not mount";
  server_.Own(disk.path());
  server_.Run(absl::StrCat("CREATE TABLESPACE small LOCATION '", disk.path(), "'"));
  const std::string database = server_.NewDatabase("TABLESPACE small");
  {
    const auto store = OpenPostgresJobStore(database);
    ASSERT_TRUE(store.ok()) << store.status();
    NewPlanningJob asked = NewJob();
    std::vector<std::string> accepted;
    absl::Status full;
    uint32_t noise = 1;
    while (full.ok() && accepted.size() < 1000) {
      // Nothing that can be compressed.
      asked.task.clear();
      for (int i = 0; i < 100'000; ++i) {
        noise = noise * 1664525u + 1013904223u;
        asked.task.push_back(static_cast<char>(noise >> 24));
      }
      const auto job = (*store)->Create(asked, {});
      full = job.status();
      if (job.ok()) accepted.push_back(job->job_id);
    }
    EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
    EXPECT_EQ(ErrorReason(full), "DISK_FULL");
    EXPECT_THAT(*(*store)->List(AllJobs()), SizeIs(accepted.size()));
    disk.Resize(64 << 20);
    for (int i = 0; i < 20; ++i) ASSERT_TRUE((*store)->Create(asked, {}).ok());
    EXPECT_THAT(*(*store)->List(AllJobs()), SizeIs(accepted.size() + 20));
    for (const std::string& id : accepted) ASSERT_TRUE((*store)->Get(id).ok());
  }
  server_.Run("DROP DATABASE test_" + database.substr(database.rfind('_') + 1) + " WITH (FORCE)");
  server_.Run("DROP TABLESPACE small");
}

}  // namespace
}  // namespace sightline
