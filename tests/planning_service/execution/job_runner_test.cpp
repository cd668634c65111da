// SPDX-License-Identifier: Apache-2.0
// Jobs from the queue to their results, with a shell script for the command.
#include "planning_service/execution/job_runner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>

#include "planning_service/jobs/planning_jobs.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class JobRunnerTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string folder = (fs::temp_directory_path() / "sightline-runner-XXXXXX").string();
    ASSERT_NE(mkdtemp(folder.data()), nullptr);
    folder_ = folder;
    fs::create_directories(folder_ + "/work");
    auto store = OpenSqliteJobStore(folder_ + "/jobs.sqlite");
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
    auto artefacts = ArtefactStore::Open(folder_ + "/artefacts", 0);
    ASSERT_TRUE(artefacts.ok()) << artefacts.status();
    artefacts_ = *std::move(artefacts);
    access_ = AllowEverybody();
    client_ = *access_->Identify({});
    jobs_ = std::make_unique<PlanningJobs>(store_.get(), artefacts_.get());
  }
  void TearDown() override {
    runner_.reset();
    fs::remove_all(folder_);
  }

  // The body sees the arguments of the command; `out` is where results go.
  void Start(const std::string& body, int workers = 1) {
    options_.program = folder_ + "/program";
    options_.work_folder = folder_ + "/work";
    options_.workers = workers;
    std::ofstream(options_.program) << "#!/bin/bash\nout=../out\n" << body << "\n";
    chmod(options_.program.c_str(), 0700);
    runner_ = std::make_unique<JobRunner>(options_, store_.get(), artefacts_.get(), access_.get(),
                                          engine_.get());
    runner_->Start();
  }

  PlanningJob Ask(int64_t seed = 1) {
    auto upload = jobs_->Upload(client_);
    EXPECT_TRUE(upload.ok());
    EXPECT_TRUE(upload->Write("a part").ok());
    auto file = upload->Finish("");
    EXPECT_TRUE(file.ok()) << file.status();
    file->name = "part.glb";
    v1::PlanningTask task;
    task.set_kind("plan");
    task.mutable_inspection()->mutable_part()->set_file("part.glb");
    task.set_seed(seed);
    auto job = jobs_->Create(client_, "", task, {*file}, 0);
    EXPECT_TRUE(job.ok()) << job.status();
    return *job;
  }

  // Waits until `done` holds.
  PlanningJob WaitFor(const PlanningJob& job, const std::function<bool(const PlanningJob&)>& done) {
    PlanningJob now = job;
    while (!done(now)) {
      auto next = store_->WaitForChange(job.job_id, now.revision, absl::Milliseconds(100));
      EXPECT_TRUE(next.ok()) << next.status();
      if (!next.ok()) break;
      now = *next;
    }
    EXPECT_TRUE(done(now)) << static_cast<int>(now.state) << " " << now.failure.message;
    return now;
  }
  PlanningJob Finished(const PlanningJob& job) {
    return WaitFor(job, [](const PlanningJob& now) { return now.IsFinished(); });
  }
  std::string Result(const PlanningJob& job, const std::string& name) {
    auto result = jobs_->Result(client_, job.job_id, name);
    EXPECT_TRUE(result.ok()) << result.status();
    if (!result.ok()) return "";
    return *artefacts_->Read(result->file.digest, 0, 1 << 20);
  }

  std::string folder_;
  JobRunnerOptions options_;
  std::unique_ptr<PlanningJobStore> store_;
  std::unique_ptr<ArtefactStore> artefacts_;
  std::unique_ptr<ClientAccess> access_;
  Client client_;
  std::unique_ptr<PlanningJobs> jobs_;
  std::unique_ptr<ComputeEngine> engine_ = MakeLocalEngine();
  std::unique_ptr<JobRunner> runner_;
};

TEST_F(JobRunnerTest, ResultsAreThoseOfTheCommand) {
  Start(R"(mkdir -p $out/points; cat part.glb > $out/plan.json; echo 1 > $out/points/scan_01.ply
grep -q part.glb inspection.json && echo "$@" > $out/arguments)");
  const PlanningJob job = Finished(Ask());
  EXPECT_EQ(job.state, JobState::kSucceeded);
  ASSERT_EQ(job.results.size(), 3u);
  EXPECT_EQ(Result(job, "plan.json"), "a part");
  EXPECT_EQ(Result(job, "points/scan_01.ply"), "1\n");
  EXPECT_THAT(Result(job, "arguments"), HasSubstr("plan inspection.json --out=../out --seed=1"));
  // Nothing of it stays behind.
  runner_.reset();
  EXPECT_FALSE(fs::exists(folder_ + "/work/" + job.job_id));
}

TEST_F(JobRunnerTest, AFailureIsTheCommands) {
  Start(R"(echo half > $out/plan.json
echo '{"error":{"code":"INVALID_ARGUMENT","reason":"","message":"part.glb: is no mesh"}}' >&2; exit 2)");
  const PlanningJob job = Finished(Ask());
  EXPECT_EQ(job.state, JobState::kFailed);
  EXPECT_EQ(job.failure.code, absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(job.failure.message, "part.glb: is no mesh");
  EXPECT_TRUE(job.results.empty());
  EXPECT_EQ(ErrorReason(jobs_->Result(client_, job.job_id, "plan.json").status()),
            "RESULT_UNKNOWN");
}

// A client reads the names of its own files, wherever the message comes from.
TEST_F(JobRunnerTest, ClientsSeeNoPathsOfTheServer) {
  options_.step_cache_folder = folder_ + "/step_cache";
  options_.hidden_folders = {folder_};
  Start(R"(echo "{\"progress\":0.5,\"message\":\"reading $PWD/part.glb\"}" >&2
while [ ! -e "$(dirname "$0")/go" ]; do sleep 0.05; done
echo "{\"error\":{\"code\":\"INVALID_ARGUMENT\",\"reason\":\"\",\"message\":\"$PWD/part.glb: is no mesh; see $PWD/$out/plan.json, $0\"}}" >&2
exit 2)");
  const PlanningJob asked = Ask();
  const PlanningJob running =
      WaitFor(asked, [](const PlanningJob& now) { return !now.message.empty(); });
  EXPECT_EQ(running.message, "reading part.glb");
  std::ofstream(folder_ + "/go") << "";
  const PlanningJob failed = Finished(asked);
  EXPECT_THAT(failed.failure.message, testing::StartsWith("part.glb: is no mesh; see "));
  EXPECT_THAT(failed.failure.message, testing::EndsWith("plan.json, program"));
  EXPECT_THAT(failed.failure.message, testing::Not(HasSubstr(folder_)));
}

// The client also gets the last lines of a process that says nothing else.
TEST_F(JobRunnerTest, LastWordsHaveNoPathsOfTheServer) {
  Start(R"(for i in $(seq 200); do echo "warning: $PWD/part.glb: line $i has no end" >&2; done
exit 3)");
  const PlanningJob failed = Finished(Ask());
  EXPECT_EQ(failed.failure.reason, "PROCESS_ENDED");
  EXPECT_THAT(failed.failure.message, HasSubstr("warning: part.glb: line 200 has no end"));
  EXPECT_THAT(failed.failure.message, testing::Not(HasSubstr("work/job-")));
}

// Each attempt gets a little further and is killed; the last finds what the others kept.
TEST_F(JobRunnerTest, AKilledJobGoesOnFromWhatItKept) {
  Start(R"(n=$(ls ../checkpoint | wc -l); touch ../checkpoint/$n
[ -e $out/left-over ] && echo broken > $out/plan.json
echo "{\"progress\":0.$((n+1)),\"message\":\"\"}" >&2; touch $out/left-over; sleep 0.5
[ $n -lt 3 ] && kill -9 $$
rm $out/left-over; [ -e $out/plan.json ] || echo whole > $out/plan.json)");
  const PlanningJob job = Finished(Ask());
  EXPECT_EQ(job.state, JobState::kSucceeded) << job.failure.message;
  EXPECT_EQ(job.attempts, 4);
  EXPECT_EQ(Result(job, "plan.json"), "whole\n");
}

TEST_F(JobRunnerTest, AJobThatOnlyCrashesFails) {
  Start("kill -SEGV $$");
  const PlanningJob job = Finished(Ask());
  EXPECT_EQ(job.state, JobState::kFailed);
  EXPECT_EQ(job.failure.reason, "PROCESS_ENDED");
  EXPECT_GT(job.attempts, 1);
}

// Random kills may hit the same job many times before it gets any further.
TEST_F(JobRunnerTest, AJobThatIsKilledOftenGoesOn) {
  Start(R"(n=$(ls ../checkpoint | wc -l); touch ../checkpoint/$n
[ $n -lt 20 ] && kill -9 $$
echo whole > $out/plan.json)");
  const PlanningJob job = Finished(Ask());
  EXPECT_EQ(job.state, JobState::kSucceeded) << job.failure.message;
  EXPECT_EQ(job.attempts, 21);
}

TEST_F(JobRunnerTest, CancelsWhatRuns) {
  Start("sleep 1000");
  const PlanningJob job = Ask();
  WaitFor(job, [](const PlanningJob& now) { return now.state == JobState::kRunning; });
  ASSERT_TRUE(jobs_->Cancel(client_, job.job_id).ok());
  EXPECT_EQ(Finished(job).state, JobState::kCancelled);
}

TEST_F(JobRunnerTest, AStopPutsJobsBack) {
  Start("sleep 1000");
  const PlanningJob job = Ask();
  WaitFor(job, [](const PlanningJob& now) { return now.state == JobState::kRunning; });
  runner_->Stop();
  auto now = store_->Get(job.job_id);
  ASSERT_TRUE(now.ok());
  EXPECT_EQ(now->state, JobState::kQueued);
  EXPECT_EQ(now->crashes, 0);
  Start("echo done > $out/plan.json");
  EXPECT_EQ(Finished(job).state, JobState::kSucceeded);
}

TEST_F(JobRunnerTest, LimitsAreThoseOfTheService) {
  options_.max_time = absl::Milliseconds(300);
  Start("sleep 1000");
  const PlanningJob job = Finished(Ask());
  EXPECT_EQ(job.failure.code, absl::StatusCode::kDeadlineExceeded);
  EXPECT_EQ(job.failure.reason, "JOB_TIME_LIMIT");
}

TEST_F(JobRunnerTest, SeveralWorkersRunEveryJobOnce) {
  Start("echo $$ >> " + folder_ + "/runs; echo x > $out/plan.json", 4);
  std::vector<PlanningJob> asked;
  for (int i = 0; i < 20; ++i) asked.push_back(Ask(i + 1));
  for (const PlanningJob& job : asked) EXPECT_EQ(Finished(job).state, JobState::kSucceeded);
  std::ifstream runs(folder_ + "/runs");
  int count = 0;
  for (std::string line; std::getline(runs, line);) ++count;
  EXPECT_EQ(count, 20);
}

// Leaves an attempt at its first Run, and takes it up at the second.
class LeavingEngine final : public ComputeEngine {
 public:
  absl::StatusOr<JobProcessEnd> Run(const AttemptOptions& options,
                                    const ProgressCallback& wish) override {
    const std::string marker = options.folder + "/in/marker";
    JobProcessEnd end;
    if (!fs::exists(options.folder + "/left")) {
      EXPECT_TRUE(options.prepare().ok());
      std::ofstream(options.folder + "/left") << "";
      std::ofstream(marker) << "";
      while ((last_wish = wish({0.5, "runs"})) == Wish::kGoOn) usleep(10000);
      end.kind = JobProcessEnd::Kind::kStopped;
      return end;
    }
    std::ofstream(options.folder + "/out/plan.json") << (fs::exists(marker) ? "kept" : "anew");
    end.kind = JobProcessEnd::Kind::kDone;
    return end;
  }

  Wish last_wish = Wish::kGoOn;
};

TEST_F(JobRunnerTest, WhatRunsOnElsewhereIsTakenUpAsItIs) {
  auto engine = std::make_unique<LeavingEngine>();
  const LeavingEngine* const leaving = engine.get();
  engine_ = std::move(engine);
  Start("exit 1");
  const PlanningJob job = Ask();
  WaitFor(job, [](const PlanningJob& now) { return now.progress > 0; });
  runner_->Stop();
  EXPECT_EQ(leaving->last_wish, Wish::kLeave);
  EXPECT_EQ(store_->Get(job.job_id)->state, JobState::kQueued);
  Start("exit 1");
  const PlanningJob done = Finished(job);
  EXPECT_EQ(done.state, JobState::kSucceeded) << done.failure.message;
  EXPECT_EQ(Result(done, "plan.json"), "kept");
}

// A symbolic link that a command left is no way to a file of the server.
TEST_F(JobRunnerTest, LinksAreNoResults) {
  Start("ln -s /etc/passwd $out/secret; echo x > $out/plan.json");
  const PlanningJob job = Finished(Ask());
  ASSERT_EQ(job.results.size(), 1u);
  EXPECT_EQ(job.results[0].name, "plan.json");
}

}  // namespace
}  // namespace sightline
