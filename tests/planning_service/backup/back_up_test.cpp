// SPDX-License-Identifier: Apache-2.0
#include "planning_service/backup/back_up.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "planning_service/artefact_store/artefact_store.h"
#include "planning_service/job_store/planning_job_store.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A data folder with a store, as of a service that runs.
class BackUpTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    data_ = folder_ + "/data";
    backup_ = folder_ + "/backup";
    artefacts_ = *ArtefactStore::Open(data_ + "/artefacts", 0);
    store_ = *OpenSqliteJobStore(data_ + "/jobs.sqlite");
  }
  void TearDown() override {
    store_.reset();
    fs::remove_all(folder_);
  }

  // A job with a file of these bytes; returns the digest.
  std::string Create(const std::string& bytes) {
    auto file = artefacts_->NewFile();
    EXPECT_TRUE((*file)->Write(bytes).ok());
    const std::string digest = *(*file)->Commit("");
    NewPlanningJob job;
    job.client = "mes";
    job.kind = "plan";
    job.task = "task of " + bytes;
    job.files = {{"part.stl", digest, static_cast<int64_t>(bytes.size())}};
    const auto created = store_->Create(job, {});
    EXPECT_TRUE(created.ok()) << created.status();
    return digest;
  }
  absl::StatusOr<BackupReport> BackUpNow(bool only_files = false) {
    return BackUp(data_, backup_, only_files, stop_);
  }
  // Checks that all files that jobs of a data folder name are there, with their bytes; returns the
  // number of jobs.
  static size_t CheckWhole(const std::string& folder) {
    auto store = OpenSqliteJobStore(folder + "/jobs.sqlite");
    EXPECT_TRUE(store.ok()) << store.status();
    const auto artefacts = *ArtefactStore::Open(folder + "/artefacts", 0);
    PlanningJobFilter all;
    all.limit = 10'000;
    const auto jobs = (*store)->List(all);
    EXPECT_TRUE(jobs.ok()) << jobs.status();
    for (const PlanningJob& listed : *jobs) {
      const auto job = (*store)->Get(listed.job_id);
      EXPECT_TRUE(job.ok()) << job.status();
      for (const JobFile& file : job->files) {
        const auto bytes = artefacts->Read(file.digest, 0, 1 << 20);
        EXPECT_TRUE(bytes.ok()) << bytes.status();
        EXPECT_EQ(job->task, "task of " + bytes.value_or(""));
      }
    }
    return jobs->size();
  }
  // Makes a file so old that it may be removed.
  void MakeOld(const std::string& digest) {
    const timespec long_ago[] = {{1, 0}, {1, 0}};
    ASSERT_EQ(utimensat(AT_FDCWD, artefacts_->Path(digest)->c_str(), long_ago, 0), 0);
  }

  std::string folder_ = "/tmp/sightline-backup-XXXXXX", data_, backup_;
  std::unique_ptr<ArtefactStore> artefacts_;
  std::unique_ptr<PlanningJobStore> store_;
  std::atomic<bool> stop_ = false;
};

TEST_F(BackUpTest, IsADataFolderOfTheSameJobs) {
  Create("one");
  Create("two");
  Create("two");
  const auto report = BackUpNow();
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->files, 2);
  EXPECT_EQ(report->copied_files, 2);
  EXPECT_EQ(report->copied_bytes, 6);
  EXPECT_EQ(CheckWhole(backup_), 3u);
}

// Work as of a service that runs: one job, then the end of the service.
int64_t ServeOneJob(const std::string& folder) {
  auto store = *OpenSqliteJobStore(folder + "/jobs.sqlite");
  EXPECT_TRUE(store->BeginService().ok());
  NewPlanningJob job;
  job.client = "mes";
  job.kind = "plan";
  job.task = "task of a later job";
  EXPECT_TRUE(store->Create(job, {}).ok());
  return *store->NewestEvent();
}

TEST_F(BackUpTest, EventIdsOfARestoredServiceWereNeverGivenBefore) {
  ASSERT_TRUE(store_->BeginService().ok());
  Create("one");
  ASSERT_TRUE(BackUpNow().ok());
  Create("two");
  Create("three");
  const int64_t delivered = *store_->NewestEvent();
  const int64_t first = ServeOneJob(backup_);
  EXPECT_GT(first, delivered);
  // Without another restore ids are consecutive.
  EXPECT_EQ(ServeOneJob(backup_), first + 1);
  // A file that was copied by other means is a restored one, too.
  const std::string copy = folder_ + "/copy";
  fs::create_directory(copy);
  fs::copy_file(backup_ + "/jobs.sqlite", copy + "/jobs.sqlite");
  EXPECT_GT(ServeOneJob(copy), first + 1000);
  // JSON numbers are exact up to 2^53.
  EXPECT_LT(ServeOneJob(copy), int64_t{1} << 53);
}

TEST_F(BackUpTest, JobsOfAnotherServiceAreNotReplaced) {
  ASSERT_TRUE(store_->BeginService().ok());
  Create("one");
  // A stopped service of its own.
  ServeOneJob((fs::create_directory(backup_), backup_));
  const absl::Status own = BackUpNow().status();
  EXPECT_TRUE(absl::IsFailedPrecondition(own)) << own;
  EXPECT_THAT(std::string(own.message()), HasSubstr("nothing was changed"));
  EXPECT_EQ((*OpenSqliteJobStore(backup_ + "/jobs.sqlite"))->List(PlanningJobFilter())->size(), 1u);
  EXPECT_FALSE(fs::exists(backup_ + "/jobs.sqlite.new"));

  // The backup of another service.
  const std::string other = folder_ + "/other", backup_of_other = folder_ + "/backup-of-other";
  ASSERT_TRUE(ArtefactStore::Open(other + "/artefacts", 0).ok());
  ServeOneJob(other);
  ASSERT_TRUE(BackUp(other, backup_of_other, false, stop_).ok());
  const absl::Status mixed = BackUp(data_, backup_of_other, false, stop_).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(mixed)) << mixed;
  EXPECT_THAT(std::string(mixed.message()), HasSubstr("another service"));
  EXPECT_TRUE(BackUp(other, backup_of_other, false, stop_).ok());
}

TEST_F(BackUpTest, GoesOnInItsFolderAfterRetentionAndALook) {
  ASSERT_TRUE(store_->BeginService().ok());
  Create("one");
  ASSERT_TRUE(BackUpNow().ok());
  // A look: `sightline serve --workers 0` on the backup.
  ASSERT_TRUE((*OpenSqliteJobStore(backup_ + "/jobs.sqlite"))->BeginService().ok());
  EXPECT_TRUE(store_->RequestCancel(store_->List(PlanningJobFilter())->front().job_id).ok());
  ASSERT_TRUE(store_->AdvanceServiceTime(absl::Hours(1)).ok());
  ASSERT_EQ(*store_->RemoveOlderThan(absl::Minutes(1)), 1);
  Create("two");
  const auto next = BackUpNow();
  EXPECT_TRUE(next.ok()) << next.status();
  EXPECT_EQ(CheckWhole(backup_), 1u);
  // A job that came to the restored service is not lost to the next backup.
  ServeOneJob(backup_);
  EXPECT_TRUE(absl::IsFailedPrecondition(BackUpNow().status()));
}

// Two services that were restored from one backup are different ones from then on.
TEST_F(BackUpTest, RestoredServicesDoNotReplaceEachOthersBackups) {
  ASSERT_TRUE(store_->BeginService().ok());
  Create("one");
  ASSERT_TRUE(BackUpNow().ok());
  const std::string a = folder_ + "/a", b = folder_ + "/b", backup = folder_ + "/backup-of-a";
  fs::copy(backup_, a, fs::copy_options::recursive);
  fs::copy(backup_, b, fs::copy_options::recursive);
  ServeOneJob(a);
  ServeOneJob(b);
  ASSERT_TRUE(BackUp(a, backup, false, stop_).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(BackUp(b, backup, false, stop_).status()));
  // Nor does the service that they come from, which goes on.
  EXPECT_TRUE(absl::IsFailedPrecondition(BackUp(data_, backup, false, stop_).status()));
  EXPECT_EQ((*OpenSqliteJobStore(backup + "/jobs.sqlite"))->List(PlanningJobFilter())->size(), 2u);
  // A restored service goes on in the folder of the backup that it was restored from, and in its
  // own after another restore.
  EXPECT_TRUE(BackUp(a, backup_, false, stop_).ok());
  const std::string again = folder_ + "/again";
  fs::copy(backup, again, fs::copy_options::recursive);
  ServeOneJob(again);
  const auto next = BackUp(again, backup, false, stop_);
  EXPECT_TRUE(next.ok()) << next.status();
}

TEST_F(BackUpTest, FilesAloneDoNotReplaceThoseOfAService) {
  const std::string digest = Create("one");
  for (const char* of_a_service : {"jobs.sqlite", "work"}) {
    const std::string target = absl::StrCat(folder_, "/", of_a_service, "-folder");
    fs::create_directories(absl::StrCat(target, "/", of_a_service));
    const absl::Status refused = BackUp(data_, target, true, stop_).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(refused)) << of_a_service << refused;
  }
  ASSERT_TRUE(BackUpNow(true).ok());
  EXPECT_TRUE(BackUpNow(true).ok());
  EXPECT_TRUE((*ArtefactStore::Open(backup_ + "/artefacts", 0))->Has(digest));
}

TEST_F(BackUpTest, IsReadableByItsOwnerOnly) {
  ASSERT_TRUE(store_->BeginService().ok());
  Create("one");
  ASSERT_TRUE(BackUpNow().ok());
  EXPECT_EQ(fs::status(backup_).permissions(), fs::perms::owner_all);
  for (const auto& entry : fs::recursive_directory_iterator(backup_ + "/artefacts")) {
    EXPECT_EQ(entry.status().permissions() & ~fs::perms::owner_all, fs::perms::none)
        << entry.path();
  }
}

TEST_F(BackUpTest, TheNextOneCopiesWhatIsNewAndDropsWhatIsGone) {
  Create("one");
  ASSERT_TRUE(BackUpNow().ok());
  Create("two");
  const auto second = BackUpNow();
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_EQ(second->files, 2);
  EXPECT_EQ(second->copied_files, 1);
  EXPECT_EQ(CheckWhole(backup_), 2u);
}

TEST_F(BackUpTest, WhileJobsComeItIsOfOneMoment) {
  std::atomic<bool> done = false;
  std::thread client([&] {
    for (int i = 0; i < 300 && !done; ++i) Create(absl::StrCat("part ", i));
  });
  size_t before = 0;
  // Until some come between backups, however slow the machine is.
  for (int i = 0; i < 1000 && (i < 5 || before < 10); ++i) {
    const auto report = BackUpNow();
    EXPECT_TRUE(report.ok()) << report.status();
    const size_t jobs = CheckWhole(backup_);
    EXPECT_GE(jobs, before);
    before = jobs;
  }
  done = true;
  client.join();
  EXPECT_GE(before, 10u);
}

TEST_F(BackUpTest, WhatItIsToCopyIsNotRemovedMeanwhile) {
  const std::string digest = Create("one");
  MakeOld(digest);
  {
    const auto hold = artefacts_->Hold();
    ASSERT_TRUE(hold.ok());
    EXPECT_EQ(*artefacts_->RemoveAllBut({}, absl::Hours(1)), 0);
    EXPECT_TRUE(artefacts_->Has(digest));
  }
  EXPECT_EQ(*artefacts_->RemoveAllBut({}, absl::Hours(1)), 3);
  EXPECT_FALSE(artefacts_->Has(digest));
}

TEST_F(BackUpTest, DamageEndsItAndTheOneBeforeStays) {
  Create("one");
  ASSERT_TRUE(BackUpNow().ok());
  const std::string digest = Create("two");
  const std::string path = *artefacts_->Path(digest);
  fs::remove(path);
  std::ofstream(path) << "twx";
  const auto damaged = BackUpNow();
  EXPECT_TRUE(absl::IsDataLoss(damaged.status())) << damaged.status();
  EXPECT_THAT(std::string(damaged.status().message()), HasSubstr(digest));
  EXPECT_EQ(CheckWhole(backup_), 1u);

  fs::remove(path);
  EXPECT_TRUE(absl::IsDataLoss(BackUpNow().status()));
  EXPECT_EQ(CheckWhole(backup_), 1u);
  stop_ = true;
  EXPECT_TRUE(absl::IsCancelled(BackUpNow().status()));
}

// The service empties the folders of its jobs, and a copy would contain itself.
TEST_F(BackUpTest, FoldersInsideTheDataFolderAreRefused) {
  Create("part");
  fs::create_directories(data_ + "/work");
  fs::create_symlink(data_, folder_ + "/link");
  for (const std::string& inside : {data_ + "/work", data_ + "/work/copy", data_ + "/artefacts",
                                    data_ + "/copy", folder_ + "/link/work/copy"}) {
    backup_ = inside;
    EXPECT_TRUE(absl::IsFailedPrecondition(BackUpNow().status())) << inside;
    EXPECT_TRUE(absl::IsFailedPrecondition(BackUpNow(/*only_files=*/true).status())) << inside;
    EXPECT_FALSE(fs::exists(inside + "/jobs.sqlite")) << inside;
  }
  // A folder whose name begins alike is another one.
  backup_ = data_ + "-copy";
  EXPECT_TRUE(BackUpNow().ok());
}

// A bug found: a backup took the folder of other files for itself, and closed it to their readers.
TEST_F(BackUpTest, FoldersOfOtherFilesAreRefusedAndStayAsTheyAre) {
  Create("part");
  backup_ = folder_ + "/others";
  fs::create_directories(backup_ + "/lost+found");
  std::ofstream(backup_ + "/precious") << "theirs";
  const fs::perms before = fs::status(backup_).permissions();
  for (const bool only_files : {false, true}) {
    EXPECT_TRUE(absl::IsFailedPrecondition(BackUpNow(only_files).status()));
    EXPECT_EQ(fs::status(backup_).permissions(), before);
    EXPECT_FALSE(fs::exists(backup_ + "/artefacts"));
  }
  fs::remove(backup_ + "/precious");
  EXPECT_TRUE(BackUpNow().ok());
  EXPECT_TRUE(BackUpNow().ok());
}

TEST_F(BackUpTest, WrongFoldersAreRefused) {
  EXPECT_TRUE(absl::IsNotFound(BackUp(folder_ + "/none", backup_, false, stop_).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(BackUp(data_, data_ + "/.", false, stop_).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(BackUp(data_, data_, true, stop_).status()));
  Create("one");
  ASSERT_TRUE(BackUpNow().ok());
  // Somebody looks into the backup.
  const auto reader = OpenSqliteJobStore(backup_ + "/jobs.sqlite");
  ASSERT_TRUE(reader.ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(BackUpNow().status()));
}

TEST_F(BackUpTest, OnlyFilesAreAllFiles) {
  Create("one");
  auto unnamed = artefacts_->NewFile();
  ASSERT_TRUE((*unnamed)->Write("upload").ok());
  ASSERT_TRUE((*unnamed)->Commit("").ok());
  const auto report = BackUpNow(true);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->copied_files, 2);
  EXPECT_FALSE(fs::exists(backup_ + "/jobs.sqlite"));
}

}  // namespace
}  // namespace sightline
