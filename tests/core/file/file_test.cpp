// SPDX-License-Identifier: Apache-2.0
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

}  // namespace
}  // namespace sightline
