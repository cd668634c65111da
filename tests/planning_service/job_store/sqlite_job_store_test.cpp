// SPDX-License-Identifier: Apache-2.0
// Tests peculiar to the embedded database.
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "absl/strings/str_cat.h"
#include "planning_service/job_store/planning_job_store.h"
#include "proto/status/rpc_status.h"
#include "tests/planning_service/job_store/store_fixture.h"

namespace sightline {
namespace {

using testing::HasSubstr;

class SqliteJobStoreTest : public testing::Test {
 protected:
  void Overwrite(std::streamoff offset, const std::string& bytes) const {
    std::fstream stream(file_, std::ios::in | std::ios::out | std::ios::binary);
    stream.seekp(offset);
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    ASSERT_TRUE(stream.good());
  }

  TemporaryFolder folder_;
  const std::string file_ = folder_.path() + "/jobs.db";
};

TEST_F(SqliteJobStoreTest, OneHasItAtATime) {
  auto store = OpenSqliteJobStore(file_);
  ASSERT_TRUE(store.ok()) << store.status();
  const absl::Status here = OpenSqliteJobStore(file_).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(here)) << here;
  EXPECT_THAT(here.message(), HasSubstr(file_));

  // By another process and another name too.
  const std::string link = folder_.path() + "/link.db";
  ASSERT_EQ(symlink(file_.c_str(), link.c_str()), 0);
  Process process([&](int output) {
    WriteLine(output, absl::StrCat(OpenSqliteJobStore(link).status().code()));
  });
  EXPECT_EQ(process.ReadLine(), absl::StrCat(absl::StatusCode::kFailedPrecondition));
  process.Kill();  // it was forked with the lock that this one holds

  store->reset();
  EXPECT_TRUE(OpenSqliteJobStore(file_).ok());
}

TEST_F(SqliteJobStoreTest, NamesWhatCannotBeOpened) {
  const absl::Status no_folder = OpenSqliteJobStore(folder_.path() + "/none/jobs.db").status();
  EXPECT_TRUE(absl::IsNotFound(no_folder)) << no_folder;
  EXPECT_THAT(no_folder.message(), HasSubstr("/none/jobs.db"));
  ASSERT_EQ(mkdir(file_.c_str(), 0777), 0);
  const absl::Status is_folder = OpenSqliteJobStore(file_).status();
  EXPECT_FALSE(is_folder.ok());
  EXPECT_THAT(is_folder.message(), HasSubstr(file_));
}

TEST_F(SqliteJobStoreTest, TellsOfDamage) {
  {
    const auto store = OpenSqliteJobStore(file_);
    ASSERT_TRUE(store.ok()) << store.status();
    for (int i = 0; i < 20; ++i) ASSERT_TRUE((*store)->Create(NewJob(), {}).ok());
  }
  struct stat info {};
  ASSERT_EQ(stat(file_.c_str(), &info), 0);
  const int64_t size_bytes = info.st_size;
  ASSERT_GT(size_bytes, 8 * 4096);
  // All pages but the first, then the first one too.
  Overwrite(4096, std::string(size_bytes - 4096, '\x5a'));
  const absl::Status pages = OpenSqliteJobStore(file_).status();
  EXPECT_TRUE(absl::IsDataLoss(pages)) << pages;
  EXPECT_THAT(pages.message(), HasSubstr(file_));
  Overwrite(0, std::string(4096, '\x5a'));
  const absl::Status header = OpenSqliteJobStore(file_).status();
  EXPECT_TRUE(absl::IsDataLoss(header)) << header;
}

TEST_F(SqliteJobStoreTest, OneDamagedPageIsFound) {
  {
    const auto store = OpenSqliteJobStore(file_);
    ASSERT_TRUE(store.ok()) << store.status();
    for (int i = 0; i < 20; ++i) ASSERT_TRUE((*store)->Create(NewJob(), {}).ok());
  }
  Overwrite(4 * 4096, std::string(4096, '\0'));
  EXPECT_TRUE(absl::IsDataLoss(OpenSqliteJobStore(file_).status()));
}

TEST_F(SqliteJobStoreTest, GoesOnOnceAFullDiskHasRoom) {
  SmallDisk disk(2 << 20);
  if (!disk.is_mounted()) GTEST_SKIP() << "may not mount";
  const auto store = OpenSqliteJobStore(disk.path() + "/jobs.db");
  ASSERT_TRUE(store.ok()) << store.status();
  NewPlanningJob asked = NewJob();
  asked.task.assign(20'000, 'x');
  std::vector<std::string> accepted;
  absl::Status full;
  while (full.ok() && accepted.size() < 1000) {
    const auto job = (*store)->Create(asked, {});
    full = job.status();
    if (job.ok()) accepted.push_back(job->job_id);
  }
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_EQ(ErrorReason(full), "DISK_FULL");
  const auto check = [&] {
    for (const std::string& id : accepted) {
      const auto job = (*store)->Get(id);
      ASSERT_TRUE(job.ok()) << job.status();
      ASSERT_EQ(job->task, asked.task);
    }
    EXPECT_EQ((*store)->List(AllJobs())->size(), accepted.size());
  };
  check();
  EXPECT_EQ(ErrorReason((*store)->Create(asked, {}).status()), "DISK_FULL");

  disk.Resize(16 << 20);
  for (int i = 0; i < 20; ++i) {
    const auto job = (*store)->Create(asked, {});
    ASSERT_TRUE(job.ok()) << job.status();
    accepted.push_back(job->job_id);
  }
  check();
  const auto events = (*store)->Events(0, std::nullopt, 10'000);
  ASSERT_EQ(events->size(), accepted.size());
  EXPECT_EQ(events->back().sequence, static_cast<int64_t>(accepted.size()));
}

}  // namespace
}  // namespace sightline
