// SPDX-License-Identifier: Apache-2.0
#include "core/process_folder/process_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>

namespace sightline {
namespace {

namespace fs = std::filesystem;

class ProcessFolderTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_NE(mkdtemp(base_.data()), nullptr); }
  void TearDown() override { fs::remove_all(base_); }

  int Entries() const {
    int count = 0;
    for ([[maybe_unused]] const auto& entry : fs::directory_iterator(base_)) ++count;
    return count;
  }

  std::string base_ = "/tmp/sightline-folder-test-XXXXXX";
};

TEST_F(ProcessFolderTest, IsPrivateAndGoesWithItsOwner) {
  std::string path;
  {
    auto made = ProcessFolder::Make(base_, "work");
    ASSERT_TRUE(made.ok()) << made.status();
    const ProcessFolder folder = *std::move(made);
    path = folder.path();
    struct stat info {};
    ASSERT_EQ(stat(path.c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0700u);
    fs::create_directories(path + "/a/b");
    std::ofstream(path + "/a/file") << "x";
    // Another process of the same name leaves it alone.
    auto other = ProcessFolder::Make(base_, "work");
    ASSERT_TRUE(other.ok());
    EXPECT_NE(other->path(), path);
    EXPECT_TRUE(fs::exists(path + "/a/file"));
  }
  EXPECT_EQ(Entries(), 0);
}

TEST_F(ProcessFolderTest, WhatAKilledProcessLeftIsRemovedByTheNext) {
  int report[2];
  ASSERT_EQ(pipe(report), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const auto folder = ProcessFolder::Make(base_, "work");
    if (folder.ok()) std::ofstream(folder->path() + "/file") << "x";
    [[maybe_unused]] const ssize_t written = write(report[1], "", 1);
    pause();
    _exit(0);
  }
  char byte = 0;
  ASSERT_EQ(read(report[0], &byte, 1), 1);
  // While it lives, and by other names, nothing happens to it.
  EXPECT_TRUE(ProcessFolder::Make(base_, "work").ok());
  EXPECT_EQ(Entries(), 1);
  ASSERT_GT(child, 1);
  ASSERT_EQ(kill(child, SIGKILL), 0);
  ASSERT_EQ(waitpid(child, nullptr, 0), child);
  EXPECT_TRUE(ProcessFolder::Make(base_, "other").ok());
  EXPECT_EQ(Entries(), 1);
  auto next = ProcessFolder::Make(base_, "work");
  ASSERT_TRUE(next.ok());
  EXPECT_EQ(Entries(), 1);
  EXPECT_FALSE(fs::exists(next->path() + "/file"));
  close(report[0]);
  close(report[1]);
}

TEST_F(ProcessFolderTest, TouchesNothingElse) {
  fs::create_directories(base_ + "/work-abcdef");  // ours by name, but not locked and not empty
  std::ofstream(base_ + "/work-abcdef/file") << "x";
  fs::create_directories(base_ + "/work-longername");  // not made by us
  std::ofstream(base_ + "/work-ghijkl") << "a file";
  fs::create_directories(base_ + "/elsewhere");
  std::ofstream(base_ + "/elsewhere/.lock") << "";
  std::ofstream(base_ + "/elsewhere/file") << "x";
  fs::create_directory_symlink(base_ + "/elsewhere", base_ + "/work-mnopqr");
  EXPECT_TRUE(ProcessFolder::Make(base_, "work").ok());
  for (const char* left : {"/work-abcdef/file", "/work-longername", "/work-ghijkl",
                           "/elsewhere/file", "/work-mnopqr"}) {
    EXPECT_TRUE(fs::exists(base_ + left)) << left;
  }
}

TEST_F(ProcessFolderTest, SaysWhyNoneCanBeMade) {
  const absl::Status status = ProcessFolder::Make(base_ + "/nowhere", "work").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("No such file or directory"));
}

}  // namespace
}  // namespace sightline
