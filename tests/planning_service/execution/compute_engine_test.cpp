// SPDX-License-Identifier: Apache-2.0
// Attempts on engines of every kind. Shell commands stand in for `sightline`, and processes of this
// machine for a cluster (fake_cluster.py).
#include "planning_service/execution/engine/compute_engine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "planning_service/execution/engine/cluster_engine.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using Kind = JobProcessEnd::Kind;
using testing::ElementsAre;
using testing::HasSubstr;

std::string ReadText(const std::string& path) {
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

std::vector<std::string> Lines(const std::string& path) {
  std::vector<std::string> lines;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

class ComputeEngineTest : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    std::string folder = (fs::temp_directory_path() / "sightline-engine-XXXXXX").string();
    ASSERT_NE(mkdtemp(folder.data()), nullptr);
    folder_ = folder;
    for (const char* name : {"/job", "/job/in", "/job/out", "/cluster", "/bin"}) {
      fs::create_directories(folder_ + name);
    }
    setenv("KUBERNETES_SCHEMA", KUBERNETES_SCHEMA, 1);
    setenv("FAKE_CLUSTER", (folder_ + "/cluster").c_str(), 1);
    for (const char* command : {"sbatch", "squeue", "scancel", "kubectl"}) {
      Executable(folder_ + "/bin/" + command,
                 absl::StrCat("exec /usr/bin/python3 " FAKE_CLUSTER_PY " ", command, " \"$@\""));
    }
    // The last argument is what it does.
    Executable(folder_ + "/program", "eval \"${@: -1}\"");
    options_.name = "job-0123456789abcdef0123456789abcdef";
    options_.program = folder_ + "/program";
    options_.folder = folder_ + "/job";
    timing_.files = absl::Milliseconds(20);
    timing_.scheduler = absl::Milliseconds(300);
    timing_.grace = absl::Seconds(1);
    timing_.stop = absl::Minutes(1);
  }
  void TearDown() override {
    // Tasks that a test left running see that their folder is gone. its tasks see that.
    fs::remove_all(folder_);
  }

  static void Executable(const std::string& path, const std::string& body) {
    std::ofstream(path) << "#!/bin/bash\n" << body << "\n";
    chmod(path.c_str(), 0700);
  }

  bool IsCluster() const { return GetParam() != "local"; }

  std::unique_ptr<ComputeEngine> Engine() const {
    if (GetParam() == "local") return MakeLocalEngine();
    if (GetParam() == "slurm") {
      SlurmOptions slurm;
      slurm.command_folder = folder_ + "/bin";
      return MakeClusterEngine(MakeSlurmScheduler(slurm), timing_);
    }
    KubernetesOptions kubernetes;
    kubernetes.image = "sightline:test";
    kubernetes.volume_claim = "data";
    kubernetes.mount_path = folder_;
    kubernetes.command_folder = folder_ + "/bin";
    return MakeClusterEngine(MakeKubernetesScheduler(kubernetes), timing_);
  }

  JobProcessEnd Run(ProgressCallback wish = {}) {
    auto end = Engine()->Run(options_, [&](const JobProgress& progress) {
      messages_.insert(progress.message);
      most_ = std::max(most_, progress.fraction);
      return wish ? wish(progress) : Wish::kGoOn;
    });
    EXPECT_TRUE(end.ok()) << end.status();
    return end.ok() ? *end : JobProcessEnd{};
  }

  void Commands(const std::vector<std::string>& parts, const std::string& conclusion) {
    options_.commands = {};
    for (const std::string& part : parts) options_.commands.parts.push_back({part});
    options_.commands.conclusion = {conclusion};
  }

  bool Exists(const std::string& name) const { return fs::exists(folder_ + "/" + name); }
  void Set(const std::string& name, const std::string& text = "") const {
    std::ofstream(folder_ + "/cluster/" + name) << text;
  }
  // Processes that have the test's folder in their command line or working folder.
  int Processes() const {
    int count = 0;
    for (const auto& entry : fs::directory_iterator("/proc")) {
      std::error_code error;
      const fs::path cwd = fs::read_symlink(entry.path() / "cwd", error);
      count += !error && cwd.string().rfind(folder_ + "/job", 0) == 0;
    }
    return count;
  }
  void WaitUntilAllEnd() const {
    WaitUntil([this] { return Processes() == 0; });
  }

  std::string folder_;
  AttemptOptions options_;
  ClusterTiming timing_;
  std::set<std::string> messages_;
  double most_ = 0;
};

TEST_P(ComputeEngineTest, TheConclusionFindsWhatAllPartsMade) {
  Commands({"sleep 0.5; echo a > ../out/1", "echo b > ../out/2", "echo c > ../out/3"},
           R"(cat ../out/? > ../out/all; echo '{"progress":0.5,"message":"merges"}' >&2; sleep 3)");
  const JobProcessEnd end = Run();
  EXPECT_EQ(end.kind, Kind::kDone) << end.failure.message;
  EXPECT_EQ(ReadText(folder_ + "/job/out/all"), "a\nb\nc\n");
  EXPECT_THAT(messages_, testing::Contains("merges"));
  EXPECT_GT(most_, 0.95);
}

TEST_P(ComputeEngineTest, ATaskThatDoesNotSplitIsOneCommand) {
  Commands({}, "pwd > ../out/where");
  EXPECT_EQ(Run().kind, Kind::kDone);
  EXPECT_THAT(ReadText(folder_ + "/job/out/where"), HasSubstr("/job/in"));
}

// Text that a shell would take for something else comes as it is.
TEST_P(ComputeEngineTest, ArgumentsAreNoShellCode) {
  Executable(folder_ + "/program", "printf '%s\\n' \"${@: -3}\" > ../out/arguments");
  options_.commands.conclusion = {"it's", "$(touch ../out/evil) `x` \"", "a b*"};
  EXPECT_EQ(Run().kind, Kind::kDone);
  EXPECT_THAT(Lines(folder_ + "/job/out/arguments"),
              ElementsAre("it's", "$(touch ../out/evil) `x` \"", "a b*"));
  EXPECT_FALSE(Exists("job/out/evil"));
}

TEST_P(ComputeEngineTest, AFailureIsTheCommandsAndEndsItsFellows) {
  Commands(
      {"sleep 1000",
       R"(sleep 0.3; echo '{"error":{"code":"INVALID_ARGUMENT","reason":"WHY","message":"bad"}}' >&2; exit 2)"},
      "touch ../out/never");
  const JobProcessEnd end = Run();
  EXPECT_EQ(end.kind, Kind::kFailed);
  EXPECT_EQ(end.failure, (JobFailure{absl::StatusCode::kInvalidArgument, "WHY", "bad"}));
  WaitUntilAllEnd();
  EXPECT_FALSE(Exists("job/out/never"));
}

TEST_P(ComputeEngineTest, ACrashIsAnEndWithoutAWord) {
  Commands({"echo 'last words' >&2; kill -SEGV $$", "true"}, "true");
  const JobProcessEnd end = Run();
  EXPECT_EQ(end.kind, Kind::kWithoutWord);
  EXPECT_FALSE(end.was_killed);
  EXPECT_THAT(end.failure.message, HasSubstr("last words"));
}

TEST_P(ComputeEngineTest, AFolderThatCannotBeMadeReadyFailsTheJob) {
  options_.prepare = [] { return absl::DataLossError("a file is damaged"); };
  Commands({}, "touch ../out/never");
  const JobProcessEnd end = Run();
  EXPECT_EQ(end.kind, Kind::kFailed);
  EXPECT_EQ(end.failure, (JobFailure{absl::StatusCode::kDataLoss, "", "a file is damaged"}));
  EXPECT_FALSE(Exists("job/out/never"));
}

TEST_P(ComputeEngineTest, ACancelEndsEverything) {
  Commands({"sleep 1000", "trap '' TERM; sleep 1000"}, "touch ../out/never");
  const JobProcessEnd end =
      Run([&](const JobProgress&) { return Processes() >= 2 ? Wish::kCancel : Wish::kGoOn; });
  EXPECT_EQ(end.kind, Kind::kStopped);
  WaitUntilAllEnd();
  EXPECT_FALSE(Exists("job/out/never"));
  EXPECT_FALSE(Exists("job/cluster.json"));
}

INSTANTIATE_TEST_SUITE_P(Engines, ComputeEngineTest,
                         testing::Values("local", "slurm", "kubernetes"),
                         [](const auto& engine) { return engine.param; });

class ClusterEngineTest : public ComputeEngineTest {};

TEST_P(ClusterEngineTest, ALostMachineIsAnEndWithoutAWordAndNothingRunsOn) {
  Commands({"touch ../out/began; sleep 1000", "sleep 1000"}, "touch ../out/never");
  const JobProcessEnd end = Run([&](const JobProgress&) {
    if (Exists("job/out/began")) Set("lose-1");
    return Wish::kGoOn;
  });
  EXPECT_EQ(end.kind, Kind::kWithoutWord);
  EXPECT_TRUE(end.was_killed);
  EXPECT_THAT(end.failure.message, HasSubstr("lost its machine"));
  EXPECT_EQ(Processes(), 0);
  fs::remove(folder_ + "/cluster/lose-1");
  Commands({"true"}, "touch ../out/whole");
  EXPECT_EQ(Run().kind, Kind::kDone);
  EXPECT_TRUE(Exists("job/out/whole"));
}

// One that nobody reaches: it is not ended, but sees that it is to.
TEST_P(ClusterEngineTest, ACommandThatNobodyReachesEndsBeforeTheNextAttempt) {
  Commands({"touch ../out/began; exec sleep 1000", "true"}, "true");
  // The workload manager loses sight of it, but it lives.
  std::string stray;
  const JobProcessEnd end = Run([&](const JobProgress&) {
    if (stray.empty() && Exists("job/out/began")) {
      for (const auto& entry : fs::directory_iterator(folder_ + "/job")) {
        const std::string tasks = entry.path().string();
        if (tasks.find("/tasks-") == std::string::npos) continue;
        stray = tasks;
        // As on a machine of its own.
        const std::string copy =
            absl::StrCat("setsid /bin/sh ", tasks, "/parts-1.sh >/dev/null 2>&1 &");
        EXPECT_EQ(system(copy.c_str()), 0);
        Set("lose-1");
      }
    }
    return Wish::kGoOn;
  });
  EXPECT_EQ(end.kind, Kind::kWithoutWord);
  EXPECT_FALSE(stray.empty());
  EXPECT_EQ(Processes(), 0);
}

TEST_P(ClusterEngineTest, ARefusedSubmissionFailsWithItsWords) {
  Set("refuse", "error: invalid partition specified: nowhere");
  Commands({}, "true");
  const JobProcessEnd end = Run();
  EXPECT_EQ(end.kind, Kind::kFailed);
  EXPECT_EQ(end.failure.reason, "CLUSTER_REFUSED");
  EXPECT_THAT(end.failure.message, HasSubstr("nowhere"));
}

TEST_P(ClusterEngineTest, AClusterThatDoesNotAnswerIsWaitedFor) {
  Set("unavailable");
  Commands({"echo 1 >> ../out/runs"}, "echo 1 >> ../out/runs");
  int asked = 0;
  const JobProcessEnd end = Run([&](const JobProgress&) {
    if (++asked == 10) fs::remove(folder_ + "/cluster/unavailable");
    return Wish::kGoOn;
  });
  EXPECT_EQ(end.kind, Kind::kDone) << end.failure.message;
  EXPECT_EQ(Lines(folder_ + "/job/out/runs").size(), 2u);
}

TEST_P(ClusterEngineTest, SilenceWhileItRunsIsNoLoss) {
  Commands({}, "touch ../out/began; sleep 1.5; touch ../out/done");
  const JobProcessEnd end = Run([&](const JobProgress&) {
    if (Exists("job/out/began")) Set("unavailable");
    return Wish::kGoOn;
  });
  EXPECT_EQ(end.kind, Kind::kDone) << end.failure.message;
  EXPECT_TRUE(Exists("job/out/done"));
}

TEST_P(ClusterEngineTest, AnUnknownStateIsNoEnd) {
  Set("state", "WONDERING");
  Commands({"sleep 0.5"}, "sleep 0.5");
  EXPECT_EQ(Run().kind, Kind::kDone);
}

// The exit code stays, though the workload manager has forgotten the array.
TEST_P(ClusterEngineTest, AForgottenArrayIsKnownByItsFiles) {
  Set("forget");
  Commands({"true"}, "true");
  EXPECT_EQ(Run().kind, Kind::kDone);
  fs::remove(folder_ + "/job/cluster.json");
  Commands({"kill -9 $PPID"}, "true");  // its script ends without leaving an exit code
  const JobProcessEnd end = Run();
  EXPECT_EQ(end.kind, Kind::kWithoutWord);
  EXPECT_TRUE(end.was_killed);
}

TEST_P(ClusterEngineTest, LimitsOfTheClusterAreTheJobs) {
  Commands({}, "exit 137");
  Set("end-1", "OUT_OF_MEMORY");
  EXPECT_EQ(Run().kind, Kind::kOutOfMemory);
  Set("end-1", "TIMEOUT");
  EXPECT_EQ(Run().kind, Kind::kOutOfTime);
}

TEST_P(ClusterEngineTest, LimitsAreAskedFor) {
  options_.max_memory_bytes = (int64_t{3} << 30) + 1;
  options_.max_time = absl::Seconds(90);
  Set("check");
  Commands({"true", "true"}, "true");
  const JobProcessEnd end = Run();
  EXPECT_EQ(end.kind, Kind::kDone) << end.failure.message;
  if (GetParam() == "kubernetes") {
    EXPECT_EQ(Lines(folder_ + "/cluster/checked").size(), 2u);
  }
  for (const std::string& line : Lines(folder_ + "/cluster/submissions")) {
    const nlohmann::json asked = nlohmann::json::parse(line)["arguments"];
    if (GetParam() == "slurm") {
      EXPECT_THAT(asked, testing::Contains("--mem=3073M"));
      EXPECT_THAT(asked, testing::Contains("--time=2"));
    } else {
      const nlohmann::json pod = asked["spec"]["template"]["spec"];
      EXPECT_EQ(pod["containers"][0]["resources"]["limits"]["memory"], "3221225473");
      EXPECT_EQ(pod["activeDeadlineSeconds"], 90);
    }
  }
}

// The service goes and comes back: arrays run on meanwhile, and each command runs once.
TEST_P(ClusterEngineTest, ALeftAttemptIsFoundAgain) {
  const std::string wait = "; until [ -e ../out/go ]; do sleep 0.05; done";
  Commands({"echo 1 >> ../out/runs" + wait, "echo 2 >> ../out/runs" + wait},
           "echo 3 >> ../out/runs");
  EXPECT_FALSE(Exists("job/cluster.json"));
  const JobProcessEnd left =
      Run([&](const JobProgress&) { return Exists("job/out/runs") ? Wish::kLeave : Wish::kGoOn; });
  EXPECT_EQ(left.kind, Kind::kStopped);
  EXPECT_TRUE(Exists("job/cluster.json"));
  EXPECT_GT(Processes(), 0);
  std::ofstream(folder_ + "/job/out/go").flush();
  EXPECT_EQ(Run().kind, Kind::kDone);
  EXPECT_EQ(Lines(folder_ + "/job/out/runs").size(), 3u);
  EXPECT_EQ(Lines(folder_ + "/cluster/submissions").size(), 2u);
}

// Killed after it had submitted parts, before it had noted that.
TEST_P(ClusterEngineTest, AnAttemptThatWasNotNotedIsCancelled) {
  Commands({"echo 1 >> ../out/runs; sleep 1000"}, "true");
  Run([&](const JobProgress&) { return Exists("job/out/runs") ? Wish::kLeave : Wish::kGoOn; });
  nlohmann::json record = nlohmann::json::parse(ReadText(folder_ + "/job/cluster.json"));
  record["conclusion"] = record["parts"] = "";
  std::ofstream(folder_ + "/job/cluster.json") << record;
  Commands({"true"}, "echo 2 >> ../out/runs");
  int running_when_prepared = -1;
  options_.prepare = [&] {
    running_when_prepared = Processes();
    return absl::OkStatus();
  };
  EXPECT_EQ(Run().kind, Kind::kDone);
  EXPECT_EQ(running_when_prepared, 0);
  EXPECT_THAT(Lines(folder_ + "/job/out/runs"), ElementsAre("1", "2"));
}

// A service that now runs its jobs on its own machine does not work beside what it left.
TEST_P(ClusterEngineTest, AnotherEngineEndsWhatWasLeft) {
  Commands({}, "echo 1 >> ../out/runs; sleep 1000");
  Run([&](const JobProgress&) { return Exists("job/out/runs") ? Wish::kLeave : Wish::kGoOn; });
  EXPECT_GT(Processes(), 0);
  Commands({}, "echo 2 >> ../out/runs");
  auto end = MakeLocalEngine()->Run(options_, [](const JobProgress&) { return Wish::kGoOn; });
  ASSERT_TRUE(end.ok()) << end.status();
  EXPECT_EQ(end->kind, Kind::kDone);
  EXPECT_EQ(Processes(), 0);
  EXPECT_THAT(Lines(folder_ + "/job/out/runs"), ElementsAre("1", "2"));
}

TEST_P(ClusterEngineTest, WhoWaitsIsToldForWhat) {
  Set("hold");
  Commands({}, "true");
  int asked = 0;
  const JobProcessEnd end = Run([&](const JobProgress&) {
    if (++asked == 40) fs::remove(folder_ + "/cluster/hold");
    return Wish::kGoOn;
  });
  EXPECT_EQ(end.kind, Kind::kDone);
  EXPECT_THAT(messages_, testing::Contains(HasSubstr("waits for a machine of the cluster")));
}

INSTANTIATE_TEST_SUITE_P(Clusters, ClusterEngineTest, testing::Values("slurm", "kubernetes"),
                         [](const auto& engine) { return engine.param; });

// Kubernetes does not tell a deletion from a loss.
class SlurmEngineTest : public ComputeEngineTest {};

// Somebody of the cluster did not want it: it does not come back.
TEST_P(SlurmEngineTest, ACancelInTheClusterFailsTheJob) {
  Commands({}, "touch ../out/began; sleep 1000");
  const JobProcessEnd end = Run([&](const JobProgress&) {
    if (Exists("job/out/began")) Set("1.cancel");
    return Wish::kGoOn;
  });
  EXPECT_EQ(end.kind, Kind::kFailed);
  EXPECT_EQ(end.failure.reason, "CLUSTER_CANCELLED");
}

INSTANTIATE_TEST_SUITE_P(Slurm, SlurmEngineTest, testing::Values("slurm"));

}  // namespace
}  // namespace sightline
