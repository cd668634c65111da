// SPDX-License-Identifier: Apache-2.0
#include "tests/planning_service/job_store/store_fixture.h"

#include <signal.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "planning_service/job_store/postgres_database.h"
#include "planning_service/job_store/sql_job_store.h"
#include "planning_service/job_store/sqlite_database.h"
#include "tests/planning_service/job_store/postgres_fixture.h"

namespace sightline {

std::string BackendName(const testing::TestParamInfo<Backend>& backend) {
  if (backend.param == Backend::kSqlite) return "Sqlite";
  return "Postgres";
}

TemporaryFolder::TemporaryFolder() : path_("/tmp/sightline_job_store_XXXXXX") {
  if (mkdtemp(path_.data()) == nullptr) std::abort();
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

SmallDisk::SmallDisk(int64_t size_bytes) {
  mounted_ = mount("none", folder_.path().c_str(), "tmpfs", 0,
                   absl::StrCat("size=", size_bytes).c_str()) == 0;
}

SmallDisk::~SmallDisk() {
  if (mounted_) umount2(folder_.path().c_str(), MNT_DETACH);
}

void SmallDisk::Resize(int64_t size_bytes) {
  ASSERT_EQ(mount("none", folder_.path().c_str(), "tmpfs", MS_REMOUNT,
                  absl::StrCat("size=", size_bytes).c_str()),
            0);
}

StoreTest::StoreTest()
    : location_(GetParam() == Backend::kSqlite ? absl::StrCat(folder_.path(), "/jobs.db")
                                               : PostgresServer::Get().NewDatabase()) {}

std::unique_ptr<SqlDatabase> StoreTest::OpenDatabase() {
  auto database = GetParam() == Backend::kSqlite ? OpenSqliteDatabase(location_)
                                                 : OpenPostgresDatabase(location_);
  EXPECT_TRUE(database.ok()) << database.status();
  return database.ok() ? *std::move(database) : nullptr;
}

absl::StatusOr<std::unique_ptr<PlanningJobStore>> StoreTest::TryOpen() {
  return OpenSqlJobStore(OpenDatabase(), [this] { return now_; });
}

PlanningJobStore& StoreTest::Reopen() {
  store_.reset();
  auto store = TryOpen();
  if (!store.ok()) {
    ADD_FAILURE() << store.status();
    std::abort();
  }
  store_ = *std::move(store);
  return *store_;
}

PlanningJob StoreTest::Create(const std::string& client, int priority) {
  const auto job = store_->Create(NewJob(client, priority), {});
  EXPECT_TRUE(job.ok()) << job.status();
  return job.value_or(PlanningJob());
}

PlanningJob StoreTest::Claim() {
  const auto job = store_->Claim(NoQuota);
  EXPECT_TRUE(job.ok()) << job.status();
  if (!job.ok() || !*job) {
    ADD_FAILURE() << "no job to claim";
    return {};
  }
  return **job;
}

std::vector<std::string> StoreTest::EventTypes(const std::string& job_id) {
  std::vector<std::string> types;
  const auto events = store_->Events(0, job_id, 1000);
  EXPECT_TRUE(events.ok()) << events.status();
  if (!events.ok()) return types;
  for (const JobEvent& event : *events) types.push_back(event.type);
  return types;
}

NewPlanningJob NewJob(const std::string& client, int priority) {
  NewPlanningJob job;
  job.client = client;
  job.kind = "plan";
  job.fingerprint.assign(1, 'f');
  job.task = std::string("task\0bytes\xff", 11);
  job.priority = priority;
  return job;
}

JobFile File(const std::string& name, char digest, int64_t size_bytes) {
  return {name, std::string(64, digest), size_bytes};
}

Attempt AttemptOf(const PlanningJob& job) { return {job.job_id, job.attempts}; }

PlanningJobFilter AllJobs(int limit) {
  PlanningJobFilter filter;
  filter.limit = limit;
  return filter;
}

PlanningJobFilter JobsOfClient(const std::string& client) {
  PlanningJobFilter filter;
  filter.client = client;
  return filter;
}

PlanningJobFilter JobsOfKinds(const std::vector<std::string>& kinds) {
  PlanningJobFilter filter;
  filter.kinds = kinds;
  return filter;
}

PlanningJobFilter JobsInState(JobState state) {
  PlanningJobFilter filter;
  filter.states = {state};
  return filter;
}

Process::Process(const std::function<void(int)>& body) {
  int ends[2];
  if (pipe(ends) != 0) std::abort();
  const pid_t parent = getpid();
  pid_ = fork();
  if (pid_ == 0) {
    close(ends[0]);
    if (getppid() == parent) body(ends[1]);
    _exit(0);
  }
  close(ends[1]);
  output_ = ends[0];
}

Process::~Process() {
  Kill();
  close(output_);
}

std::string Process::ReadLine() {
  while (true) {
    const size_t end = read_.find('\n');
    if (end != std::string::npos) {
      std::string line = read_.substr(0, end);
      read_.erase(0, end + 1);
      return line;
    }
    char bytes[4096];
    const ssize_t size = read(output_, bytes, sizeof(bytes));
    if (size <= 0) return "";
    read_.append(bytes, size);
  }
}

void Process::Kill() {
  if (pid_ < 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

void WriteLine(int fd, const std::string& line) {
  const std::string bytes = absl::StrCat(line, "\n");
  if (write(fd, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) _exit(1);
}

}  // namespace sightline
