// SPDX-License-Identifier: Apache-2.0
// How an embedded server starts, played by shell scripts. Descriptor 3 of a script is its lifeline:
// reading from it blocks until the test has no use for the script any more.
#include "planner_client/embedded_server/embedded_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <atomic>
#include <fstream>
#include <string>
#include <thread>

#include "absl/time/clock.h"
#include "core/process_folder/process_folder.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

constexpr char kListens[] = "echo listening on here; read line <&3";
constexpr char kNeverListens[] = "read line <&3";

class EmbeddedServerTest : public ::testing::Test {
 protected:
  absl::StatusOr<std::unique_ptr<EmbeddedServer>> Start(const std::string& script) {
    options_.binary = folder_->path() + "/server";
    std::ofstream(options_.binary) << "#!/bin/sh\n" << script << "\n";
    chmod(options_.binary.c_str(), 0700);
    return EmbeddedServer::Start(options_);
  }

  absl::StatusOr<ProcessFolder> folder_ = ProcessFolder::Make(TemporaryBase(), "embedded-test");
  EmbeddedServerOptions options_;
};

TEST_F(EmbeddedServerTest, SlowServersAreWaitedFor) {
  options_.start_notice = absl::Milliseconds(50);
  testing::internal::CaptureStderr();
  const auto slow = Start("sleep 0.5; " + std::string(kListens));
  const std::string notice = testing::internal::GetCapturedStderr();
  ASSERT_TRUE(slow.ok()) << slow.status();
  EXPECT_THAT(notice, HasSubstr("the coverage server (process "));
  EXPECT_THAT(notice, HasSubstr("has not listened for 50ms; still waiting. Its messages: " +
                                (*slow)->folder() + "/stderr.log\n"));
  EXPECT_EQ(notice.find('\n'), notice.size() - 1);
}

TEST_F(EmbeddedServerTest, StartsWithoutANotice) {
  testing::internal::CaptureStderr();
  EXPECT_TRUE(Start(kListens).ok());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST_F(EmbeddedServerTest, ServersThatEndAreReported) {
  // The second leaves a process behind that keeps the pipe of stdout open.
  for (const char* script : {"echo why >&2; exit 3", "read line <&3 & echo why >&2; exit 3"}) {
    const absl::Status ended = Start(script).status();
    EXPECT_EQ(ended.code(), absl::StatusCode::kUnavailable) << script;
    EXPECT_THAT(std::string(ended.message()), HasSubstr("ended with exit code 3")) << script;
    EXPECT_THAT(std::string(ended.message()), HasSubstr("why")) << script;
  }
}

TEST_F(EmbeddedServerTest, KilledServersAreRestarted) {
  EXPECT_TRUE(
      Start("test -e $0.was || { touch $0.was; kill -9 $$; }; " + std::string(kListens)).ok());
}

TEST_F(EmbeddedServerTest, ServersThatCloseStdoutAreReported) {
  options_.stop_timeout = absl::Milliseconds(100);
  const absl::Status closed = Start("exec >&-; echo why >&2; read line <&3").status();
  EXPECT_EQ(closed.code(), absl::StatusCode::kUnavailable) << closed;
  EXPECT_THAT(std::string(closed.message()), HasSubstr("closed its stdout before it listened"));
  EXPECT_THAT(std::string(closed.message()), HasSubstr("why"));
}

TEST_F(EmbeddedServerTest, ServersThatNeverListenAreGivenUp) {
  options_.start_limit = absl::Milliseconds(200);
  for (const char* script : {kNeverListens, "while :; do :; done"}) {
    const absl::Status late = Start(script).status();
    EXPECT_EQ(late.code(), absl::StatusCode::kDeadlineExceeded) << late;
    EXPECT_THAT(std::string(late.message()), HasSubstr("did not listen within 200ms")) << script;
  }
}

// With the default limits: only the interruption can end these starts.
TEST_F(EmbeddedServerTest, AnInterruptionEndsTheStart) {
  std::atomic<bool> interrupted = true;
  options_.interrupted = &interrupted;
  EXPECT_EQ(Start(kNeverListens).status().code(), absl::StatusCode::kCancelled);

  interrupted = false;
  std::thread user([&] {
    absl::SleepFor(absl::Milliseconds(200));
    interrupted = true;
  });
  const absl::Status status = Start(kNeverListens).status();
  user.join();
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled) << status;
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("interrupted while the coverage server was starting"));
}

TEST_F(EmbeddedServerTest, AnInterruptedCommandMayRestartItsServer) {
  std::atomic<bool> interrupted = false;
  options_.interrupted = &interrupted;
  const auto server = Start(kListens);
  ASSERT_TRUE(server.ok()) << server.status();
  interrupted = true;
  ASSERT_EQ(kill((*server)->pid(), SIGKILL), 0);
  while ((*server)->CheckAlive().ok()) absl::SleepFor(absl::Milliseconds(1));
  EXPECT_TRUE((*server)->Restart().ok());
}

}  // namespace
}  // namespace sightline
