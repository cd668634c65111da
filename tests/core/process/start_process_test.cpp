// SPDX-License-Identifier: Apache-2.0
#include "core/process/start_process.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <iterator>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

int Wait(pid_t pid) {
  int status = 0;
  EXPECT_EQ(waitpid(pid, &status, 0), pid);
  return status;
}

std::string ReadToTheEnd(int fd) {
  std::string text;
  std::array<char, 256> buffer;
  ssize_t got;
  while ((got = read(fd, buffer.data(), buffer.size())) > 0) {
    text.append(buffer.data(), static_cast<size_t>(got));
  }
  close(fd);
  return text;
}

// Text that `script` writes to its descriptor `number`.
std::string Said(const std::string& script, int number, const std::string& folder = "") {
  int ends[2];
  EXPECT_EQ(pipe2(ends, O_CLOEXEC), 0);
  const auto pid = StartProcess({.words = {"/bin/sh", "-c", script},
                                 .folder = folder,
                                 .descriptors = {{.number = number, .ours = ends[1]}}});
  close(ends[1]);
  EXPECT_TRUE(pid.ok()) << pid.status();
  std::string text = ReadToTheEnd(ends[0]);
  if (pid.ok()) {
    EXPECT_EQ(Wait(*pid), 0);
  }
  return text;
}

TEST(StartProcess, PassesArgumentsFolderAndDescriptors) {
  EXPECT_EQ(Said("printf '%s' \"$(pwd)\"", 1, "/usr"), "/usr");
  EXPECT_EQ(Said("printf four >&4", 4), "four");
  // Standard input is empty.
  EXPECT_EQ(Said("cat; printf end", 1), "end");
}

TEST(StartProcess, DescriptorsMayTradePlaces) {
  int ends[2];
  ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
  const int null = open("/dev/null", O_WRONLY | O_CLOEXEC);
  ASSERT_GE(null, 0);
  // Each is to be where the other is now.
  const auto pid = StartProcess(
      {.words = {"/bin/sh", "-c", absl::StrCat("printf x >&", null)},
       .descriptors = {{.number = ends[1], .ours = null}, {.number = null, .ours = ends[1]}}});
  close(ends[1]);
  close(null);
  ASSERT_TRUE(pid.ok()) << pid.status();
  EXPECT_EQ(ReadToTheEnd(ends[0]), "x");
  EXPECT_EQ(Wait(*pid), 0);
}

TEST(StartProcess, LooksInPathOnlyIfAsked) {
  const auto found = StartProcess({.words = {"true"}, .in_path = true});
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_EQ(Wait(*found), 0);
  const auto missing = StartProcess({.words = {"true"}});
  EXPECT_EQ(missing.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(missing.status().message(), HasSubstr("cannot start true: No such file"));
}

TEST(StartProcess, LeadsItsGroupAndHearsSignals) {
  // The child does not inherit our blocked and ignored signals.
  sigset_t term, before;
  sigemptyset(&term);
  sigaddset(&term, SIGTERM);
  ASSERT_EQ(sigprocmask(SIG_BLOCK, &term, &before), 0);
  const auto handler = signal(SIGINT, SIG_IGN);
  for (const int number : {SIGTERM, SIGINT}) {
    const auto pid = StartProcess({.words = {"/bin/sleep", "60"}});
    ASSERT_TRUE(pid.ok()) << pid.status();
    EXPECT_EQ(getpgid(*pid), *pid);
    EXPECT_EQ(kill(-*pid, number), 0);
    const int status = Wait(*pid);
    EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == number);
  }
  signal(SIGINT, handler);
  sigprocmask(SIG_SETMASK, &before, nullptr);
}

TEST(StartProcess, LeavesNoDescriptorsBehind) {
  const auto open_descriptors = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
  };
  const auto before = open_descriptors();
  Said("true", 1);
  EXPECT_FALSE(
      StartProcess({.words = {"/no/program"}, .descriptors = {{.number = 5, .ours = 1}}}).ok());
  EXPECT_EQ(open_descriptors(), before);
}

TEST(StartProcess, StaysInOurGroupIfAsked) {
  const auto pid = StartProcess({.words = {"/bin/sleep", "60"}, .in_our_group = true});
  ASSERT_TRUE(pid.ok()) << pid.status();
  EXPECT_EQ(getpgid(*pid), getpgrp());
  EXPECT_EQ(kill(*pid, SIGKILL), 0);
  Wait(*pid);
}

// Not a test of its own: the program that the tests below start. Says that it runs, and waits.
TEST(EndWithParent, DISABLED_Child) {
  EndWithParent();
  ASSERT_EQ(write(3, "x", 1), 1);
  pause();
}

std::vector<std::string> ChildWords() {
  return {std::filesystem::read_symlink("/proc/self/exe").string(),
          "--gtest_also_run_disabled_tests", "--gtest_filter=EndWithParent.DISABLED_Child"};
}

TEST(EndWithParent, TheKernelEndsItWithItsParent) {
  int ends[2];
  ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
  const pid_t parent = fork();
  ASSERT_GE(parent, 0);
  if (parent == 0) {
    const auto child = StartProcess({.words = ChildWords(),
                                     .descriptors = {{.number = 3, .ours = ends[1]}},
                                     .ends_with_us = true});
    close(ends[1]);
    if (child.ok()) pause();
    _exit(1);
  }
  close(ends[1]);
  char said = 0;
  EXPECT_EQ(read(ends[0], &said, 1), 1);
  EXPECT_EQ(kill(parent, SIGKILL), 0);
  Wait(parent);
  // Its end of the pipe closes with it.
  EXPECT_EQ(read(ends[0], &said, 1), 0);
  close(ends[0]);
}

TEST(EndWithParent, EndsAtOnceIfItsParentHasGone) {
  // Another process than the one that started it.
  std::vector<std::string> words = {"/usr/bin/env", "SIGHTLINE_PARENT_PID=1"};
  for (const std::string& word : ChildWords()) words.push_back(word);
  const auto pid = StartProcess({.words = words});
  ASSERT_TRUE(pid.ok()) << pid.status();
  const int status = Wait(*pid);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) << status;
}

}  // namespace
}  // namespace sightline
