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
  // What every job of a data folder names is there, with its bytes; returns the number of jobs.
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
