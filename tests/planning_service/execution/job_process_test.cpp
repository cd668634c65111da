// SPDX-License-Identifier: Apache-2.0
// Attempts as processes: shell scripts stand in for the command.
#include "planning_service/execution/job_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "planning_service/execution/process_memory.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using Kind = JobProcessEnd::Kind;
using testing::HasSubstr;

class JobProcessTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string folder = (fs::temp_directory_path() / "sightline-process-XXXXXX").string();
    ASSERT_NE(mkdtemp(folder.data()), nullptr);
    folder_ = folder;
  }
  void TearDown() override { fs::remove_all(folder_); }

  JobProcessOptions Script(const std::string& body) const {
    JobProcessOptions options;
    options.program = folder_ + "/program";
    options.folder = folder_;
    std::ofstream(options.program) << "#!/bin/bash\n" << body << "\n";
    chmod(options.program.c_str(), 0700);
    return options;
  }

  static bool GoOn(const JobProgress&) { return true; }

  std::string folder_;
};

TEST_F(JobProcessTest, ProgressAndEndAreTold) {
  const auto options = Script(
      R"(echo '{"progress":0.25,"message":"a"}' >&2; until [ -e seen_a ]; do sleep 0.02; done
echo 'for people' >&2; echo '{"progress":0.75,"message":"b"}' >&2
until [ -e seen_b ]; do sleep 0.02; done; pwd > where; exit 0)");
  std::vector<double> seen;
  auto end = RunJobProcess(options, [&](const JobProgress& progress) {
    if (seen.empty() || seen.back() != progress.fraction) seen.push_back(progress.fraction);
    // The process goes on once its words have arrived.
    if (!progress.message.empty()) std::ofstream(folder_ + "/seen_" + progress.message).flush();
    return true;
  });
  ASSERT_TRUE(end.ok()) << end.status();
  EXPECT_EQ(end->kind, Kind::kDone);
  EXPECT_THAT(seen, testing::IsSupersetOf({0.25, 0.75}));
  std::string where;
  std::ifstream(folder_ + "/where") >> where;
  EXPECT_EQ(fs::path(where), fs::canonical(folder_));
}

// Temporary files of a job, those of its servers included, are gone with the job's folder.
TEST_F(JobProcessTest, TemporaryFilesGoToItsOwnFolder) {
  JobProcessOptions options = Script("bash -c 'mktemp > where; stat -c %a $TMPDIR > mode'");
  options.temporary_folder = folder_ + "/tmp";
  for (int attempt = 0; attempt < 2; ++attempt) {
    const auto end = RunJobProcess(options, GoOn);
    ASSERT_TRUE(end.ok()) << end.status();
    EXPECT_EQ(end->kind, Kind::kDone);
    std::string where, mode;
    std::ifstream(folder_ + "/where") >> where;
    std::ifstream(folder_ + "/mode") >> mode;
    EXPECT_EQ(fs::path(where).parent_path(), options.temporary_folder);
    EXPECT_EQ(mode, "700");
  }
  options.temporary_folder = folder_ + "/none/tmp";
  EXPECT_TRUE(absl::IsUnavailable(RunJobProcess(options, GoOn).status()));
}

TEST_F(JobProcessTest, AReasonIsPassedOn) {
  const auto options = Script(
      R"(echo '{"error":{"code":"INVALID_ARGUMENT","reason":"WHY","message":"bad part"}}' >&2; exit 2)");
  auto end = RunJobProcess(options, GoOn);
  ASSERT_TRUE(end.ok());
  EXPECT_EQ(end->kind, Kind::kFailed);
  EXPECT_EQ(end->failure, (JobFailure{absl::StatusCode::kInvalidArgument, "WHY", "bad part"}));
}

TEST_F(JobProcessTest, AnEndWithoutAWordSaysHow) {
  auto killed = RunJobProcess(Script("echo 'last words' >&2; kill -9 $$"), GoOn);
  ASSERT_TRUE(killed.ok());
  EXPECT_EQ(killed->kind, Kind::kWithoutWord);
  EXPECT_THAT(killed->failure.message, HasSubstr("signal 9"));
  EXPECT_THAT(killed->failure.message, HasSubstr("last words"));
  auto silent = RunJobProcess(Script("exit 3"), GoOn);
  ASSERT_TRUE(silent.ok());
  EXPECT_EQ(silent->kind, Kind::kWithoutWord);
  EXPECT_THAT(silent->failure.message, HasSubstr("exit code 3"));
}

TEST_F(JobProcessTest, StopsWhenAsked) {
  auto end = RunJobProcess(Script("sleep 1000"), [](const JobProgress&) { return false; });
  ASSERT_TRUE(end.ok());
  EXPECT_EQ(end->kind, Kind::kStopped);
}

// One that does not listen, nor its child.
TEST_F(JobProcessTest, IsKilledWhenItDoesNotStop) {
  const auto options = Script("trap '' TERM INT; sleep 1000 & echo $! > child; wait; wait");
  auto end = RunJobProcess(options, [&](const JobProgress&) {
    return !fs::exists(folder_ + "/child") || fs::file_size(folder_ + "/child") == 0;
  });
  ASSERT_TRUE(end.ok());
  EXPECT_EQ(end->kind, Kind::kStopped);
  pid_t child = 0;
  std::ifstream(folder_ + "/child") >> child;
  ASSERT_GT(child, 0);
  // Killed with its parent's group; its new parent may not have reaped it yet.
  WaitUntil([&] {
    std::ifstream stat("/proc/" + std::to_string(child) + "/stat");
    std::string line;
    std::getline(stat, line);
    return line.empty() || line.find(") Z") != std::string::npos;
  });
}

TEST_F(JobProcessTest, TimeIsLimited) {
  JobProcessOptions options = Script("sleep 1000");
  options.max_time = absl::Milliseconds(300);
  auto end = RunJobProcess(options, GoOn);
  ASSERT_TRUE(end.ok());
  EXPECT_EQ(end->kind, Kind::kOutOfTime);
}

// The memory is that of a child of the process.
TEST_F(JobProcessTest, MemoryOfAllItsProcessesIsLimited) {
  JobProcessOptions options =
      Script("python3 -c 'import time; b = bytearray(300 << 20); time.sleep(1000)' & wait");
  options.max_memory_bytes = int64_t{150} << 20;
  options.max_time = absl::Hours(24);
  auto end = RunJobProcess(options, GoOn);
  ASSERT_TRUE(end.ok());
  EXPECT_EQ(end->kind, Kind::kOutOfMemory);
}

TEST_F(JobProcessTest, MemoryOfThisProcessIsKnown) {
  const int64_t before = ProcessTreeMemory(getpid());
  EXPECT_GT(before, 1 << 20);
  std::vector<char> block(size_t{64} << 20, 1);
  EXPECT_GT(ProcessTreeMemory(getpid()), before + (int64_t{48} << 20));
  EXPECT_GT(block[block.size() / 2], 0);
}

TEST_F(JobProcessTest, SaysWhenThereIsNoProgram) {
  JobProcessOptions options;
  options.program = folder_ + "/no-such-program";
  options.folder = folder_;
  auto end = RunJobProcess(options, GoOn);
  // posix_spawn may tell at once, or the child ends with 127.
  EXPECT_TRUE(!end.ok() || end->kind == Kind::kWithoutWord);
}

// Garbage of any kind on stderr is no progress and no crash.
TEST_F(JobProcessTest, WhatItSaysMayBeAnything) {
  auto end =
      RunJobProcess(Script(R"(head -c 300000 /dev/urandom >&2; echo >&2; echo '{"progress":"x"}' >&2
echo '{"progress":1e999}' >&2; echo '{"error":7}' >&2; echo '[' >&2; exit 0)"),
                    GoOn);
  ASSERT_TRUE(end.ok());
  EXPECT_EQ(end->kind, Kind::kDone);
}

}  // namespace
}  // namespace sightline
