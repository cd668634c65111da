// SPDX-License-Identifier: Apache-2.0
#include "core/process/run_program.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <string>

namespace sightline {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

absl::StatusOr<FinishedProgram> RunScript(const std::string& script, const ProgramLimits& limits) {
  return RunProgram({.words = {"/bin/sh", "-c", script}}, limits);
}

constexpr ProgramLimits kPatient = {.time_limit = absl::Seconds(60)};

TEST(RunProgram, CollectsWhatItWritesAndHowItEnds) {
  const auto well = RunScript("cat; printf answer; printf note >&2", kPatient);
  ASSERT_TRUE(well.ok()) << well.status();
  EXPECT_EQ(well->output, "answer");
  EXPECT_EQ(well->errors, "note");
  EXPECT_EQ(well->wait_status, 0);
  const auto wrong = RunScript("exit 3", kPatient);
  ASSERT_TRUE(wrong.ok()) << wrong.status();
  EXPECT_EQ(WEXITSTATUS(wrong->wait_status), 3);
  const auto killed = RunScript("kill -9 $$", kPatient);
  ASSERT_TRUE(killed.ok()) << killed.status();
  EXPECT_EQ(WTERMSIG(killed->wait_status), SIGKILL);
  // More than a pipe holds, on both at a time.
  const auto much = RunScript(
      "head -c 1000000 /dev/zero | tr '\\0' e >&2; head -c 1000000 /dev/zero; printf end >&2",
      kPatient);
  ASSERT_TRUE(much.ok()) << much.status();
  EXPECT_EQ(much->output.size(), 1000000u);
  EXPECT_LE(much->errors.size(), 4000u);
  EXPECT_THAT(much->errors, EndsWith("eend"));
}

TEST(RunProgram, MissingProgramsAreNamed) {
  const auto missing = RunProgram({.words = {"/no/program"}}, kPatient);
  EXPECT_TRUE(absl::IsUnavailable(missing.status())) << missing.status();
  EXPECT_THAT(std::string(missing.status().message()), HasSubstr("/no/program"));
}

TEST(RunProgram, EndsWhatTakesTooLong) {
  const ProgramLimits impatient = {.time_limit = absl::Milliseconds(200)};
  // Also one that closes its pipes, or leaves the work to a program of its own.
  for (const char* script : {"exec sleep 60", "exec >&- 2>&-; exec sleep 60", "sleep 60; true"}) {
    const auto late = RunScript(script, impatient);
    EXPECT_TRUE(absl::IsDeadlineExceeded(late.status())) << late.status();
    EXPECT_THAT(std::string(late.status().message()), HasSubstr("/bin/sh took longer than 200ms"));
  }
}

TEST(RunProgram, EndsWhatWritesTooMuch) {
  const auto endless = RunScript("exec cat /dev/zero",
                                 {.time_limit = absl::Seconds(60), .max_output_bytes = 1 << 20});
  EXPECT_TRUE(absl::IsResourceExhausted(endless.status())) << endless.status();
  EXPECT_THAT(std::string(endless.status().message()), HasSubstr("more than 1 MiB"));
}

}  // namespace
}  // namespace sightline
