#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "core/file/folder_lock.h"
#include "core/file/read_file.h"
#include "core/file/temporary_folder.h"
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
  using Kind = FolderLock::Kind;
  {
    const auto first = FolderLock::Take(folder_.string());
    ASSERT_TRUE(first.ok()) << first.status();
    for (const Kind kind : {Kind::kExclusive, Kind::kShared}) {
      EXPECT_TRUE(absl::IsFailedPrecondition(FolderLock::Take(folder_.string(), kind).status()));
    }
  }
  const auto shared = FolderLock::Take(folder_.string(), Kind::kShared);
  ASSERT_TRUE(shared.ok());
  EXPECT_TRUE(FolderLock::Take(folder_.string(), Kind::kShared).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(FolderLock::Take(folder_.string()).status()));
  EXPECT_TRUE(absl::IsNotFound(FolderLock::Take(Path("none")).status()));
}

void MakeOld(const fs::path& path) {
  fs::last_write_time(path, fs::file_time_type::clock::now() - std::chrono::minutes(2));
}

TEST_F(FileTest, TemporaryFoldersGoAlsoThoseOfProcessesThatWereKilled) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const pid_t child = fork();
  if (child == 0) {
    const auto folder = TemporaryFolder::Make(folder_.string(), "work");
    std::ofstream(folder->path() + "/file") << "x";
    if (write(ends[1], folder->path().data(), folder->path().size()) < 0) _exit(1);
    pause();
    _exit(0);
  }
  char buffer[500];
  const ssize_t size = read(ends[0], buffer, sizeof(buffer));
  ASSERT_GT(size, 0);
  const std::string left(buffer, static_cast<size_t>(size));
  ASSERT_TRUE(fs::exists(left + "/file"));
  MakeOld(left);
  std::string own;
  {
    // In use: it stays, however old.
    const auto folder = TemporaryFolder::Make(folder_.string(), "work");
    ASSERT_TRUE(folder.ok()) << folder.status();
    own = folder->path();
    EXPECT_TRUE(fs::exists(left));
    EXPECT_EQ(fs::status(own).permissions(), fs::perms::owner_all);
  }
  EXPECT_FALSE(fs::exists(own));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  fs::create_directories(folder_ / "work-of_another_kind");
  MakeOld(folder_ / "work-of_another_kind");
  ASSERT_TRUE(TemporaryFolder::Make(folder_.string(), "work").ok());
  EXPECT_FALSE(fs::exists(left));
  EXPECT_TRUE(fs::exists(folder_ / "work-of_another_kind"));
  close(ends[0]);
  close(ends[1]);
}

}  // namespace
}  // namespace sightline
