// SPDX-License-Identifier: Apache-2.0
// Job stores over both databases, for tests.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/types.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "planning_service/job_store/planning_job_store.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

enum class Backend { kSqlite, kPostgres };

std::string BackendName(const testing::TestParamInfo<Backend>& backend);

// A folder of its own that goes with the object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// A file system of limited size in memory.
class SmallDisk {
 public:
  // Not mounted if the test may not mount.
  explicit SmallDisk(int64_t size_bytes);
  ~SmallDisk();
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool is_mounted() const { return mounted_; }
  void Resize(int64_t size_bytes);
  std::string path() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
  bool mounted_ = false;
};

// An empty database of its own, and a store over it whose clock stands still unless it is moved.
class StoreTest : public testing::TestWithParam<Backend> {
 protected:
  StoreTest();
  std::unique_ptr<SqlDatabase> OpenDatabase();
  absl::StatusOr<std::unique_ptr<PlanningJobStore>> TryOpen();
  // Closes the store, if it is open, and opens it.
  PlanningJobStore& Reopen();

  PlanningJob Create(const std::string& client = "mes", int priority = 0);
  // The next job; fails the test if there is none.
  PlanningJob Claim();
  std::vector<std::string> EventTypes(const std::string& job_id);

  TemporaryFolder folder_;
  std::string location_;  // file, or libpq's text
  std::chrono::steady_clock::time_point now_{std::chrono::hours(1)};
  std::unique_ptr<PlanningJobStore> store_;
};

NewPlanningJob NewJob(const std::string& client = "mes", int priority = 0);
// A file of a digest made of one character.
JobFile File(const std::string& name, char digest, int64_t size_bytes);
Attempt AttemptOf(const PlanningJob& job);
// Filters: all jobs, or those of one property.
PlanningJobFilter AllJobs(int limit = 10'000);
PlanningJobFilter JobsOfClient(const std::string& client);
PlanningJobFilter JobsOfKinds(const std::vector<std::string>& kinds);
PlanningJobFilter JobsInState(JobState state);
inline ClientQuota NoQuota(const std::string&) { return {}; }

// Another process, which ends with the object if not before.
class Process {
 public:
  // Runs `body(fd)` with the writing end of a pipe.
  explicit Process(const std::function<void(int)>& body);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  // The next line that it wrote; empty at the end.
  std::string ReadLine();
  // Ends it by SIGKILL and waits until it is gone; what it wrote can still be read.
  void Kill();

 private:
  pid_t pid_ = -1;
  int output_ = -1;
  std::string read_;
};
void WriteLine(int fd, const std::string& line);

}  // namespace sightline
