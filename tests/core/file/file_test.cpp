// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"
#include "core/file/file_lock.h"
#include "core/file/read_file.h"
#include "tests/limits/within_limits.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class FileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / absl::StrCat("file_test_", getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  fs::path folder_;
};

TEST_F(FileTest, ReadsRegularFilesAndNothingElse) {
  std::ofstream(Path("a")) << "contents";
  EXPECT_EQ(ReadRegularFile(Path("a"), 8).value(), "contents");
  EXPECT_THAT(ReadRegularFile(Path("a"), 7).status().ToString(),
              HasSubstr("a: has 8 bytes, at most 7 bytes can be read"));
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  const auto error = [&](const std::string& path) {
    return WithinLimits({.cpu_time_s = 1}, [&] {
      return ReadRegularFile(path, uint64_t{1} << 30).status().ToString();
    });
  };
  EXPECT_THAT(error(Path("pipe")), HasSubstr("INVALID_ARGUMENT"));
  EXPECT_THAT(error("/dev/zero"), HasSubstr("no regular file"));
  EXPECT_THAT(error(Path("")), HasSubstr("is a folder"));
  EXPECT_THAT(error(Path("none")), HasSubstr("NOT_FOUND"));
  fs::resize_file(Path("a"), uint64_t{1} << 40);
  EXPECT_THAT(error(Path("a")), HasSubstr("has 1048576 MiB, at most 1024 MiB"));
  EXPECT_EQ(ReadRegularFile("/proc/self/comm", 100).value().back(), '\n');  // claims 0 bytes
}

TEST_F(FileTest, ALockEndsWithItsHolder) {
  using Kind = FileLock::Kind;
  {
    const auto first = FileLock::TakeFolder(folder_.string());
    ASSERT_TRUE(first.ok()) << first.status();
    for (const Kind kind : {Kind::kExclusive, Kind::kShared}) {
      EXPECT_TRUE(
          absl::IsFailedPrecondition(FileLock::TakeFolder(folder_.string(), kind).status()));
    }
  }
  const auto shared = FileLock::TakeFolder(folder_.string(), Kind::kShared);
  ASSERT_TRUE(shared.ok());
  EXPECT_TRUE(FileLock::TakeFolder(folder_.string(), Kind::kShared).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(FileLock::TakeFolder(folder_.string()).status()));
  EXPECT_TRUE(absl::IsNotFound(FileLock::TakeFolder(Path("none")).status()));
}

TEST_F(FileTest, FilesAreLockedAndAwaited) {
  const std::string path = Path("lock");
  {
    const auto held = FileLock::TakeFile(path);
    ASSERT_TRUE(held.ok()) << held.status();
    EXPECT_TRUE(absl::IsFailedPrecondition(FileLock::TakeFile(path).status()));
    int asked = 0;
    const auto stopped = FileLock::AwaitFile(
        path, [&] { return ++asked < 3 ? absl::OkStatus() : absl::CancelledError("stopped"); });
    EXPECT_TRUE(absl::IsCancelled(stopped.status()));
    EXPECT_EQ(asked, 3);
  }
  EXPECT_TRUE(FileLock::AwaitFile(path, nullptr).ok());
  struct stat info {};
  ASSERT_EQ(stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  EXPECT_TRUE(absl::IsNotFound(FileLock::TakeFile(Path("none/lock")).status()));
}

TEST_F(FileTest, UnfinishedFilesLeaveNothing) {
  const std::string path = Path("a");
  ASSERT_TRUE(WriteFileAtomically(path, "old").ok());
  {
    auto file = UnfinishedFile::Make(path, kPrivateFile);
    ASSERT_TRUE(file.ok()) << file.status();
    EXPECT_THAT(file->temporary_path(), HasSubstr(kUnfinishedMark));
    ASSERT_TRUE(file->Write("half of ").ok());
    UnfinishedFile moved = *std::move(file);
    EXPECT_EQ(ReadRegularFile(path, 100).value(), "old");
  }
  EXPECT_EQ(ReadRegularFile(path, 100).value(), "old");
  auto file = UnfinishedFile::Make(path, kPrivateFile);
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_TRUE(file->Write("half of ").ok());
  ASSERT_TRUE(file->Write("it").ok());
  ASSERT_TRUE(file->Commit().ok());
  EXPECT_EQ(ReadRegularFile(path, 100).value(), "half of it");
  struct stat info {};
  ASSERT_EQ(stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, kPrivateFile);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
  EXPECT_TRUE(absl::IsNotFound(WriteFileAtomically(Path("none/a"), "x")));
  fs::create_directory(Path("folder"));
  EXPECT_FALSE(WriteFileAtomically(Path("folder"), "x").ok());
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 2);
}

}  // namespace
}  // namespace sightline
