#include "planning_service/job_store/sql_job_store.h"

#include <algorithm>
#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <tuple>
#include <type_traits>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "planning_service/job_store/job_schema.h"
#include "planning_service/job_store/plain_text.h"
#include "planning_service/job_store/postgres_database.h"
#include "planning_service/job_store/random_number.h"
#include "planning_service/job_store/sqlite_database.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

using std::chrono::steady_clock;

constexpr int kMaxRows = 10'000;
constexpr size_t kMaxFilterValues = 100;
constexpr size_t kMaxMessageBytes = 64 << 10;
constexpr auto kProgressEventInterval = std::chrono::seconds(1);
// How often a shared database is asked for changes that others made.
constexpr absl::Duration kPollInterval = absl::Milliseconds(500);
constexpr absl::Duration kLongestWait = absl::Hours(24 * 365);

constexpr char kJobColumns[] =
    "job_id, sequence, client, kind, request_id, fingerprint, priority, state, progress, message, "
    "cancel_requested, attempts, crashes, failure_code, failure_reason, failure_message, "
    "created_us, started_us, finished_us, revision, traceparent";
constexpr char kServiceTime[] = "(SELECT value FROM counter WHERE name = 'service_us')";
constexpr char kFinishedStates[] = "('SUCCEEDED', 'FAILED', 'CANCELLED')";

// States are words in the database, for people who look into it.
constexpr std::pair<JobState, const char*> kStates[] = {{JobState::kQueued, "QUEUED"},
                                                        {JobState::kRunning, "RUNNING"},
                                                        {JobState::kSucceeded, "SUCCEEDED"},
                                                        {JobState::kFailed, "FAILED"},
                                                        {JobState::kCancelled, "CANCELLED"}};

std::string ToText(JobState state) {
  for (const auto& [known, text] : kStates) {
    if (known == state) return text;
  }
  return "";
}

JobState ToState(const std::string& text) {
  for (const auto& [state, known] : kStates) {
    if (known == text) return state;
  }
  return JobState::kFailed;
}

// 0 is "never".
int64_t ToMicros(absl::Time time) {
  return time == absl::InfinitePast() ? 0 : absl::ToUnixMicros(time);
}
absl::Time ToTime(int64_t micros) {
  return micros == 0 ? absl::InfinitePast() : absl::FromUnixMicros(micros);
}

// Whose names a file list belongs to; see table named_file.
struct Holder {
  std::string client;
  std::string kind;
  std::string id;
};

PlanningJob ToJob(const SqlRow& row) {
  PlanningJob job;
  job.job_id = row.Text(0);
  job.sequence = row.Int(1);
  job.client = row.Text(2);
  job.kind = row.Text(3);
  job.request_id = row.Text(4);
  job.fingerprint = row.Text(5);
  job.priority = static_cast<int>(row.Int(6));
  job.state = ToState(row.Text(7));
  job.progress = row.Real(8);
  job.message = row.Text(9);
  job.cancel_requested = row.Int(10) != 0;
  job.attempts = static_cast<int>(row.Int(11));
  job.crashes = static_cast<int>(row.Int(12));
  job.failure = {static_cast<absl::StatusCode>(row.Int(13)), row.Text(14), row.Text(15)};
  job.created = ToTime(row.Int(16));
  job.started = ToTime(row.Int(17));
  job.finished = ToTime(row.Int(18));
  job.revision = row.Int(19);
  job.traceparent = row.Text(20);
  return job;
}

JobFile ToFile(const SqlRow& row, size_t first_column) {
  return {row.Text(first_column), row.Text(first_column + 1), row.Int(first_column + 2)};
}

// Row without task and files of the first job that fits.
std::optional<PlanningJob> FindJobRow(SqlTransaction& sql, const std::string& where,
                                      const std::vector<SqlValue>& parameters) {
  const SqlRows rows =
      sql.Run(absl::StrCat("SELECT ", kJobColumns, " FROM job WHERE ", where), parameters);
  if (rows.empty()) return std::nullopt;
  return ToJob(rows.front());
}

std::vector<JobFile> FilesOf(SqlTransaction& sql, const Holder& holder) {
  std::vector<JobFile> files;
  for (const SqlRow& row :
       sql.Run("SELECT name, digest, size_bytes FROM named_file"
               " WHERE holder_id = $1 AND holder = $2 AND client = $3 ORDER BY place",
               {holder.id, holder.kind, holder.client})) {
    files.push_back(ToFile(row, 0));
  }
  return files;
}

void ReplaceFiles(SqlTransaction& sql, const Holder& holder, const std::vector<JobFile>& files) {
  sql.Run("DELETE FROM named_file WHERE holder_id = $1 AND holder = $2 AND client = $3",
          {holder.id, holder.kind, holder.client});
  for (size_t i = 0; i < files.size(); ++i) {
    sql.Run(absl::StrCat("INSERT INTO named_file (client, holder, holder_id, place, name, digest,"
                         " size_bytes, made_service_us) VALUES ($1, $2, $3, $4, $5, $6, $7, ",
                         kServiceTime, ")"),
            {holder.client, holder.kind, holder.id, static_cast<int64_t>(i), files[i].name,
             files[i].digest, files[i].size_bytes});
  }
}

std::optional<PlanningJob> FindJob(SqlTransaction& sql, const std::string& job_id) {
  auto job = FindJobRow(sql, "job_id = $1", {job_id});
  if (!job) return std::nullopt;
  const SqlRows task = sql.Run("SELECT task FROM job WHERE job_id = $1", {job_id});
  if (!task.empty()) job->task = task.front().Bytes(0);
  job->files = FilesOf(sql, {job->client, "file", job_id});
  job->results = FilesOf(sql, {job->client, "result", job_id});
  return job;
}

int64_t NextNumber(SqlTransaction& sql, const std::string& counter) {
  const SqlRows rows =
      sql.Run("UPDATE counter SET value = value + 1 WHERE name = $1 RETURNING value", {counter});
  return rows.empty() ? 0 : rows.front().Int(0);
}

// Tells of the job as it is now.
void AddEvent(SqlTransaction& sql, const std::string& type, const PlanningJob& job) {
  const int64_t sequence = NextNumber(sql, "event");
  sql.Run(absl::StrCat("INSERT INTO event (sequence, type, time_us, job_id, client, kind, state,"
                       " progress, message, failure_code, failure_reason, failure_message,"
                       " revision, request_id, priority, attempts, made_service_us)"
                       " VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15,"
                       " $16, ",
                       kServiceTime, ")"),
          {sequence, type, ToMicros(absl::Now()), job.job_id, job.client, job.kind,
           ToText(job.state), job.progress, job.message, static_cast<int64_t>(job.failure.code),
           job.failure.reason, job.failure.message, job.revision, job.request_id,
           int64_t{job.priority}, int64_t{job.attempts}});
  for (size_t i = 0; i < job.results.size(); ++i) {
    sql.Run(
        "INSERT INTO event_result (event_sequence, place, name, digest, size_bytes)"
        " VALUES ($1, $2, $3, $4, $5)",
        {sequence, static_cast<int64_t>(i), job.results[i].name, job.results[i].digest,
         job.results[i].size_bytes});
  }
}

// Ends the job; `state`, `message`, `failure` and `results` are as they shall be.
void Finish(SqlTransaction& sql, const std::string& event_type, PlanningJob* job) {
  job->cancel_requested = false;
  job->finished = absl::Now();
  ++job->revision;
  sql.Run(absl::StrCat("UPDATE job SET state = $2, progress = $3, message = $4,"
                       " cancel_requested = 0, failure_code = $5, failure_reason = $6,"
                       " failure_message = $7, finished_us = $8, revision = $9,"
                       " finished_service_us = ",
                       kServiceTime, " WHERE job_id = $1"),
          {job->job_id, ToText(job->state), job->progress, job->message,
           static_cast<int64_t>(job->failure.code), job->failure.reason, job->failure.message,
           ToMicros(job->finished), job->revision});
  ReplaceFiles(sql, {job->client, "result", job->job_id}, job->results);
  AddEvent(sql, event_type, *job);
}

void FinishCancelled(SqlTransaction& sql, PlanningJob* job) {
  job->state = JobState::kCancelled;
  job->message = "cancelled";
  Finish(sql, "cancelled", job);
}

// Puts a running job back. One that was asked to stop has stopped, and is not run again for that.
// Returns whether it is in the queue.
bool PutBack(SqlTransaction& sql, PlanningJob* job, bool crashed, bool advanced) {
  if (advanced) job->crashes = 0;
  if (crashed) ++job->crashes;
  sql.Run(
      "UPDATE job SET state = 'QUEUED', crashes = $2, revision = revision + 1 WHERE job_id = $1",
      {job->job_id, int64_t{job->crashes}});
  if (crashed) {
    sql.Run("UPDATE job SET crash_progress = progress WHERE job_id = $1", {job->job_id});
  }
  ++job->revision;
  if (!job->cancel_requested) return true;
  FinishCancelled(sql, job);
  return false;
}

// Of different files that the client holds, or that anybody does.
int64_t StoredBytes(SqlTransaction& sql, const std::optional<std::string>& client) {
  const std::string files = absl::StrCat("SELECT MAX(size_bytes) AS size_bytes FROM named_file",
                                         client ? " WHERE client = $1" : "", " GROUP BY digest");
  const SqlRows rows =
      sql.Run(absl::StrCat("SELECT CAST(COALESCE(SUM(size_bytes), 0) AS BIGINT) FROM (", files,
                           ") AS files"),
              client ? std::vector<SqlValue>{*client} : std::vector<SqlValue>{});
  return rows.empty() ? 0 : rows.front().Int(0);
}

int CountJobs(SqlTransaction& sql, JobState state, const std::optional<std::string>& client) {
  const SqlRows rows = client
                           ? sql.Run("SELECT COUNT(*) FROM job WHERE state = $1 AND client = $2",
                                     {ToText(state), *client})
                           : sql.Run("SELECT COUNT(*) FROM job WHERE state = $1", {ToText(state)});
  return rows.empty() ? 0 : static_cast<int>(rows.front().Int(0));
}

absl::Status QuotaExceeded(const std::string& what, int64_t has, int64_t allowed) {
  return WithErrorInfo(
      absl::ResourceExhaustedError(absl::StrCat(what, ": ", has, ", allowed are ", allowed)),
      "QUOTA_EXCEEDED", {{"allowed", absl::StrCat(allowed)}});
}

// Called after the change, which is undone if it goes too far.
absl::Status CheckStoredBytes(SqlTransaction& sql, const std::string& client,
                              const ClientQuota& quota) {
  const int64_t stored = StoredBytes(sql, client);
  if (stored <= quota.max_stored_bytes) return absl::OkStatus();
  return QuotaExceeded(absl::StrCat("max_stored_bytes of client ", client), stored,
                       quota.max_stored_bytes);
}

absl::Status CheckNames(const std::vector<std::pair<std::string, std::string>>& names,
                        const std::vector<JobFile>& files) {
  std::vector<FieldViolation> violations;
  const auto check = [&violations](const std::string& field, const std::string& value) {
    if (IsPlainText(value)) return;
    violations.push_back(
        {field, absl::StrCat("is \"", absl::CHexEscape(value), "\", must be UTF-8 without NUL")});
  };
  for (const auto& [field, value] : names) check(field, value);
  for (size_t i = 0; i < files.size(); ++i) {
    check(absl::StrCat("files[", i, "].name"), files[i].name);
    check(absl::StrCat("files[", i, "].digest"), files[i].digest);
  }
  return InvalidFields(violations);
}

absl::Status JobUnknown(const std::string& job_id) {
  return WithErrorInfo(
      absl::NotFoundError(absl::StrCat("no job \"", absl::CHexEscape(job_id), "\"")),
      "JOB_UNKNOWN");
}

absl::Status NotCurrent(const Attempt& attempt) {
  return absl::AbortedError(absl::StrCat("attempt ", attempt.number, " of job ", attempt.job_id,
                                         " is not its current one"));
}

// Condition over a column and as many values as there are; adds these to `parameters`.
std::string IsOneOf(const std::string& column, const std::vector<std::string>& values,
                    std::vector<SqlValue>* parameters) {
  std::vector<std::string> places;
  for (const std::string& value : values) {
    parameters->emplace_back(value);
    places.push_back(absl::StrCat("$", parameters->size()));
  }
  return absl::StrCat(column, " IN (", absl::StrJoin(places, ", "), ")");
}

const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <typename T>
const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
  return result.status();
}

// Two connections, so that who reads does not wait until a write is on disk.
class SqlJobStore : public PlanningJobStore {
 public:
  SqlJobStore(std::unique_ptr<SqlDatabase> database, std::unique_ptr<SqlConnection> writer,
              std::unique_ptr<SqlConnection> reader, SteadyClock clock)
      : database_(std::move(database)),
        clock_(std::move(clock)),
        writer_(std::move(writer)),
        reader_(std::move(reader)) {}

  absl::StatusOr<PlanningJob> Create(const NewPlanningJob& job, const ClientQuota& quota) override;
  absl::StatusOr<PlanningJob> Get(const std::string& job_id) override;
  absl::StatusOr<std::vector<PlanningJob>> List(const PlanningJobFilter& filter) override;
  absl::StatusOr<PlanningJob> RequestCancel(const std::string& job_id) override;
  absl::StatusOr<PlanningJob> WaitForChange(const std::string& job_id, int64_t revision,
                                            absl::Duration timeout) override;
  absl::StatusOr<Counts> Count(const std::optional<std::string>& client) override;
  absl::StatusOr<std::optional<PlanningJob>> Claim(
      const std::function<ClientQuota(const std::string& client)>& quota_of) override;
  absl::StatusOr<bool> ReportProgress(const Attempt& attempt, double progress,
                                      const std::string& message) override;
  absl::Status Succeed(const Attempt& attempt, const std::vector<JobFile>& results) override;
  absl::Status Fail(const Attempt& attempt, const JobFailure& failure) override;
  absl::Status MarkCancelled(const Attempt& attempt) override;
  absl::Status Requeue(const Attempt& attempt, bool crashed, bool advanced) override;
  absl::StatusOr<int> RequeueOrphans() override;
  absl::StatusOr<Recipe> GetRecipe(const std::string& client,
                                   const std::string& recipe_id) override;
  absl::Status PutRecipe(const Recipe& recipe, const ClientQuota& quota) override;
  absl::Status DeleteRecipe(const std::string& client, const std::string& recipe_id) override;
  absl::StatusOr<int> CountRecipes(const std::string& client) override;
  absl::Status AddUpload(const std::string& client, const JobFile& file,
                         const ClientQuota& quota) override;
  absl::StatusOr<std::optional<int64_t>> FindFile(const std::string& client,
                                                  const std::string& digest) override;
  absl::StatusOr<std::vector<JobEvent>> Events(int64_t after_sequence,
                                               const std::optional<std::string>& job_id,
                                               int limit) override;
  void WaitForEvent(int64_t after_sequence, absl::Duration timeout) override;
  absl::StatusOr<int64_t> EventCursor(const std::string& receiver) override;
  absl::Status SetEventCursor(const std::string& receiver, int64_t sequence) override;
  bool HoldsReceiver(const std::string& receiver) override;
  absl::Status AdvanceServiceTime(absl::Duration by) override;
  absl::StatusOr<int> RemoveOlderThan(absl::Duration age) override;
  absl::StatusOr<std::set<std::string>> NamedDigests() override;

 private:
  template <typename Body>
  using ResultOf = std::invoke_result_t<Body, SqlTransaction&>;

  // Runs `body(sql)` in a transaction; its result, unless a statement or the commit fails. An error
  // of the body undoes everything.
  template <typename Body>
  static ResultOf<Body> InTransaction(SqlConnection* connection, SqlAccess access, Body body) {
    if (absl::Status begun = connection->Begin(access); !begun.ok()) return begun;
    SqlTransaction sql(connection);
    ResultOf<Body> result = body(sql);
    if (!sql.status().ok()) result = sql.status();
    if (!StatusOf(result).ok()) {
      connection->Rollback();
      return result;
    }
    if (absl::Status committed = connection->Commit(); !committed.ok()) {
      connection->Rollback();
      return committed;
    }
    return result;
  }

  template <typename Body>
  ResultOf<Body> Read(Body body) {
    std::lock_guard lock(read_mutex_);
    return InTransaction(reader_.get(), SqlAccess::kRead, std::move(body));
  }

  template <typename Body>
  ResultOf<Body> Write(Body body) {
    ResultOf<Body> result = [&] {
      std::lock_guard lock(write_mutex_);
      return InTransaction(writer_.get(), SqlAccess::kWrite, std::move(body));
    }();
    // After an error too: a commit whose answer was lost may have happened.
    Changed();
    return result;
  }

  // As Write, with `body(sql, owner)`. Jobs of an owner number that was lost with its connection
  // get the new one, unless somebody else has taken them meanwhile.
  template <typename Body>
  auto WriteAsOwner(Body body) -> std::invoke_result_t<Body, SqlTransaction&, int64_t> {
    const absl::StatusOr<int64_t> owner = database_->Owner();
    if (!owner.ok()) return owner.status();
    auto result = Write([&](SqlTransaction& sql) {
      own_numbers_.insert(*owner);
      for (const int64_t number : own_numbers_) {
        if (number == *owner) continue;
        sql.Run("UPDATE job SET owner = $1 WHERE owner = $2 AND state = 'RUNNING'",
                {*owner, number});
      }
      return body(sql, *owner);
    });
    if (StatusOf(result).ok()) {
      std::lock_guard lock(write_mutex_);
      own_numbers_ = {*owner};
    }
    return result;
  }

  // Runs `body(sql, job)` for the job of an attempt that is its current one.
  template <typename Body>
  auto WriteAttempt(const Attempt& attempt, Body body)
      -> std::invoke_result_t<Body, SqlTransaction&, PlanningJob*> {
    using Result = std::invoke_result_t<Body, SqlTransaction&, PlanningJob*>;
    return WriteAsOwner([&](SqlTransaction& sql, int64_t owner) -> Result {
      auto job =
          FindJobRow(sql, "job_id = $1 AND attempts = $2 AND owner = $3 AND state = 'RUNNING'",
                     {attempt.job_id, int64_t{attempt.number}, owner});
      if (!job) {
        last_progress_event_.erase(attempt.job_id);
        return NotCurrent(attempt);
      }
      return body(sql, &*job);
    });
  }

  void Changed() {
    {
      std::lock_guard lock(change_mutex_);
      ++changes_;
    }
    changed_.notify_all();
  }

  int64_t Changes() {
    std::lock_guard lock(change_mutex_);
    return changes_;
  }

  // Until the number of changes is another than `seen`, something may have happened elsewhere, or
  // `end`.
  void AwaitChange(int64_t seen, steady_clock::time_point end) {
    if (database_->IsShared()) {
      end = std::min(end, steady_clock::now() + absl::ToChronoMilliseconds(kPollInterval));
    }
    std::unique_lock lock(change_mutex_);
    changed_.wait_until(lock, end, [&] { return changes_ != seen; });
  }

  static steady_clock::time_point EndOf(absl::Duration timeout) {
    // An endless wait is cut: the clock's arithmetic would overflow.
    return steady_clock::now() +
           absl::ToChronoMilliseconds(std::clamp(timeout, absl::ZeroDuration(), kLongestWait));
  }

  const std::unique_ptr<SqlDatabase> database_;
  const SteadyClock clock_;

  std::mutex write_mutex_;
  const std::unique_ptr<SqlConnection> writer_;  // by write_mutex_, as all up to the next mutex
  // Numbers under which jobs of this store may stand.
  std::set<int64_t> own_numbers_;
  std::map<std::string, steady_clock::time_point> last_progress_event_;  // by job

  std::mutex read_mutex_;
  const std::unique_ptr<SqlConnection> reader_;  // by read_mutex_

  std::mutex change_mutex_;
  std::condition_variable changed_;
  int64_t changes_ = 0;  // by change_mutex_
};

absl::StatusOr<PlanningJob> SqlJobStore::Create(const NewPlanningJob& job,
                                                const ClientQuota& quota) {
  const absl::Status names = CheckNames({{"client", job.client},
                                         {"kind", job.kind},
                                         {"request_id", job.request_id},
                                         {"fingerprint", job.fingerprint}},
                                        job.files);
  if (!names.ok()) return names;
  return Write([&](SqlTransaction& sql) -> absl::StatusOr<PlanningJob> {
    if (!job.request_id.empty()) {
      const auto known = FindJobRow(sql, "client = $1 AND request_id = $2 AND request_id <> ''",
                                    {job.client, job.request_id});
      if (known && known->fingerprint != job.fingerprint) {
        return WithErrorInfo(absl::AlreadyExistsError(
                                 absl::StrCat("request_id \"", job.request_id,
                                              "\" was used for another task, job ", known->job_id)),
                             "REQUEST_ID_REUSED", {{"job_id", known->job_id}});
      }
      if (known) {
        auto whole = FindJob(sql, known->job_id);
        if (!whole) return sql.status();
        return *std::move(whole);
      }
    }
    const int queued = CountJobs(sql, JobState::kQueued, job.client);
    if (queued >= quota.max_queued_jobs) {
      return QuotaExceeded(absl::StrCat("max_queued_jobs of client ", job.client), queued + 1,
                           quota.max_queued_jobs);
    }
    PlanningJob made;
    made.job_id = absl::StrFormat("job-%016x%016x", RandomBits(), RandomBits());
    made.sequence = NextNumber(sql, "job");
    made.client = job.client;
    made.kind = job.kind;
    made.request_id = job.request_id;
    made.traceparent = job.traceparent;
    made.fingerprint = job.fingerprint;
    made.task = job.task;
    made.files = job.files;
    made.priority = job.priority;
    made.created = absl::FromUnixMicros(absl::ToUnixMicros(absl::Now()));
    made.revision = 1;
    sql.Run(
        "INSERT INTO job (job_id, sequence, client, kind, request_id, fingerprint, task,"
        " priority, state, created_us, revision, traceparent)"
        " VALUES ($1, $2, $3, $4, $5, $6, $7, $8, 'QUEUED', $9, $10, $11)",
        {made.job_id, made.sequence, made.client, made.kind, made.request_id, made.fingerprint,
         SqlBytes{made.task}, int64_t{made.priority}, ToMicros(made.created), made.revision,
         made.traceparent});
    ReplaceFiles(sql, {made.client, "file", made.job_id}, made.files);
    AddEvent(sql, "accepted", made);
    const absl::Status room = CheckStoredBytes(sql, made.client, quota);
    if (!room.ok()) return room;
    return made;
  });
}

absl::StatusOr<PlanningJob> SqlJobStore::Get(const std::string& job_id) {
  if (!IsPlainText(job_id)) return JobUnknown(job_id);
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<PlanningJob> {
    auto job = FindJob(sql, job_id);
    if (!job) return JobUnknown(job_id);
    return *std::move(job);
  });
}

absl::StatusOr<std::vector<PlanningJob>> SqlJobStore::List(const PlanningJobFilter& filter) {
  std::vector<std::string> states;
  for (const JobState state : filter.states) states.push_back(ToText(state));
  if (states.size() > kMaxFilterValues || filter.kinds.size() > kMaxFilterValues) {
    return absl::InvalidArgumentError(
        absl::StrCat("a list of states or kinds must have at most ", kMaxFilterValues, " values"));
  }
  std::vector<std::pair<std::string, std::string>> names;
  for (const std::string& kind : filter.kinds) names.emplace_back("kinds", kind);
  if (filter.client) names.emplace_back("client", *filter.client);
  if (const absl::Status checked = CheckNames(names, {}); !checked.ok()) return checked;

  std::vector<SqlValue> parameters = {int64_t{std::clamp(filter.limit, 1, kMaxRows)}};
  std::vector<std::string> conditions = {"sequence > 0"};
  if (filter.client) conditions.push_back(IsOneOf("client", {*filter.client}, &parameters));
  if (!states.empty()) conditions.push_back(IsOneOf("state", states, &parameters));
  if (!filter.kinds.empty()) conditions.push_back(IsOneOf("kind", filter.kinds, &parameters));
  if (filter.before_sequence > 0) {
    parameters.emplace_back(filter.before_sequence);
    conditions.push_back(absl::StrCat("sequence < $", parameters.size()));
  }
  const std::string where = absl::StrJoin(conditions, " AND ");
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<std::vector<PlanningJob>> {
    std::vector<PlanningJob> jobs;
    std::map<std::string, size_t> places;
    for (const SqlRow& row : sql.Run(absl::StrCat("SELECT ", kJobColumns, " FROM job WHERE ", where,
                                                  " ORDER BY sequence DESC LIMIT $1"),
                                     parameters)) {
      jobs.push_back(ToJob(row));
      places[jobs.back().job_id] = jobs.size() - 1;
    }
    for (const SqlRow& row :
         sql.Run(absl::StrCat("SELECT holder_id, name, digest, size_bytes FROM named_file"
                              " WHERE holder = 'result' AND holder_id IN (SELECT job_id FROM job"
                              " WHERE ",
                              where, " ORDER BY sequence DESC LIMIT $1) ORDER BY holder_id, place"),
                 parameters)) {
      const auto place = places.find(row.Text(0));
      if (place != places.end()) jobs[place->second].results.push_back(ToFile(row, 1));
    }
    return jobs;
  });
}

absl::StatusOr<PlanningJob> SqlJobStore::RequestCancel(const std::string& job_id) {
  if (!IsPlainText(job_id)) return JobUnknown(job_id);
  return Write([&](SqlTransaction& sql) -> absl::StatusOr<PlanningJob> {
    auto job = FindJob(sql, job_id);
    if (!job) return JobUnknown(job_id);
    if (job->state == JobState::kQueued) {
      FinishCancelled(sql, &*job);
    } else if (job->state == JobState::kRunning && !job->cancel_requested) {
      job->cancel_requested = true;
      ++job->revision;
      sql.Run("UPDATE job SET cancel_requested = 1, revision = $2 WHERE job_id = $1",
              {job_id, job->revision});
    }
    return *std::move(job);
  });
}

absl::StatusOr<PlanningJob> SqlJobStore::WaitForChange(const std::string& job_id, int64_t revision,
                                                       absl::Duration timeout) {
  if (!IsPlainText(job_id)) return JobUnknown(job_id);
  const auto end = EndOf(timeout);
  while (true) {
    const int64_t seen = Changes();
    const auto now = Read([&](SqlTransaction& sql) -> absl::StatusOr<int64_t> {
      const SqlRows rows = sql.Run("SELECT revision FROM job WHERE job_id = $1", {job_id});
      if (rows.empty()) return JobUnknown(job_id);
      return rows.front().Int(0);
    });
    if (!now.ok()) return now.status();
    if (*now > revision || steady_clock::now() >= end) return Get(job_id);
    AwaitChange(seen, end);
  }
}

absl::StatusOr<PlanningJobStore::Counts> SqlJobStore::Count(
    const std::optional<std::string>& client) {
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<Counts> {
    Counts counts;
    counts.queued = CountJobs(sql, JobState::kQueued, client);
    counts.running = CountJobs(sql, JobState::kRunning, client);
    counts.stored_bytes = StoredBytes(sql, client);
    return counts;
  });
}

absl::StatusOr<std::optional<PlanningJob>> SqlJobStore::Claim(
    const std::function<ClientQuota(const std::string& client)>& quota_of) {
  // Polled all the time: an empty queue is not worth a place among the writers.
  const auto waiting = Read([](SqlTransaction& sql) -> absl::StatusOr<bool> {
    return !sql.Run("SELECT 1 FROM job WHERE state = 'QUEUED' LIMIT 1").empty();
  });
  if (!waiting.ok()) return waiting.status();
  if (!*waiting) return std::nullopt;

  return WriteAsOwner([&](SqlTransaction& sql,
                          int64_t owner) -> absl::StatusOr<std::optional<PlanningJob>> {
    std::map<std::string, int64_t> running;
    for (const SqlRow& row :
         sql.Run("SELECT client, COUNT(*) FROM job WHERE state = 'RUNNING' GROUP BY client")) {
      running[row.Text(0)] = row.Int(1);
    }
    // The first of every client and priority, by (-priority, running jobs, sequence).
    std::optional<std::tuple<int64_t, int64_t, int64_t>> best;
    for (const SqlRow& row : sql.Run("SELECT client, priority, MIN(sequence) FROM job"
                                     " WHERE state = 'QUEUED' GROUP BY client, priority")) {
      const std::string client = row.Text(0);
      if (running[client] >= quota_of(client).max_running_jobs) continue;
      const std::tuple<int64_t, int64_t, int64_t> rank(-row.Int(1), running[client], row.Int(2));
      if (!best || rank < *best) best = rank;
    }
    if (!best) return std::nullopt;
    const SqlRows claimed = sql.Run(
        "UPDATE job SET state = 'RUNNING', owner = $2, attempts = attempts + 1,"
        " started_us = $3, revision = revision + 1 WHERE sequence = $1 RETURNING job_id",
        {std::get<2>(*best), owner, ToMicros(absl::Now())});
    if (claimed.empty()) return std::nullopt;
    return FindJob(sql, claimed.front().Text(0));
  });
}

absl::StatusOr<bool> SqlJobStore::ReportProgress(const Attempt& attempt, double progress,
                                                 const std::string& message) {
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::StatusOr<bool> {
    const PlanningJob before = *job;
    // Progress never goes back; NaN changes nothing.
    job->progress = std::max(job->progress, std::min(progress, 1.0));
    job->message = ToPlainText(message, kMaxMessageBytes);
    if (job->progress == before.progress && job->message == before.message) {
      return job->cancel_requested;
    }
    ++job->revision;
    sql.Run("UPDATE job SET progress = $2, message = $3, revision = $4 WHERE job_id = $1",
            {job->job_id, job->progress, job->message, job->revision});
    const auto now = clock_();
    const auto last = last_progress_event_.find(job->job_id);
    if (last == last_progress_event_.end() || now - last->second >= kProgressEventInterval) {
      AddEvent(sql, "progress", *job);
      last_progress_event_[job->job_id] = now;
    }
    return job->cancel_requested;
  });
}

absl::Status SqlJobStore::Succeed(const Attempt& attempt, const std::vector<JobFile>& results) {
  if (const absl::Status names = CheckNames({}, results); !names.ok()) return names;
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::Status {
    job->state = JobState::kSucceeded;
    job->progress = 1;
    job->message.clear();  // it told of what the job was doing
    job->results = results;
    Finish(sql, "done", job);
    last_progress_event_.erase(job->job_id);
    return absl::OkStatus();
  });
}

absl::Status SqlJobStore::Fail(const Attempt& attempt, const JobFailure& failure) {
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::Status {
    job->state = JobState::kFailed;
    job->failure = {failure.code, ToPlainText(failure.reason, kMaxMessageBytes),
                    ToPlainText(failure.message, kMaxMessageBytes)};
    Finish(sql, "failed", job);
    last_progress_event_.erase(job->job_id);
    return absl::OkStatus();
  });
}

absl::Status SqlJobStore::MarkCancelled(const Attempt& attempt) {
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::Status {
    FinishCancelled(sql, job);
    last_progress_event_.erase(job->job_id);
    return absl::OkStatus();
  });
}

absl::Status SqlJobStore::Requeue(const Attempt& attempt, bool crashed, bool advanced) {
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::Status {
    PutBack(sql, job, crashed, advanced);
    return absl::OkStatus();
  });
}

absl::StatusOr<int> SqlJobStore::RequeueOrphans() {
  return WriteAsOwner([&](SqlTransaction& sql, int64_t own) -> absl::StatusOr<int> {
    int requeued = 0;
    for (const SqlRow& row : sql.Run("SELECT DISTINCT owner FROM job WHERE state = 'RUNNING'")) {
      const int64_t owner = row.Int(0);
      if (owner == own) continue;
      const auto gone = database_->IsOwnerGone(sql.connection(), owner);
      if (!gone.ok()) return gone.status();
      if (!*gone) continue;
      // Nobody knows how far the attempt got but from the progress it told.
      for (const SqlRow& orphan :
           sql.Run(absl::StrCat("SELECT ", kJobColumns,
                                ", progress > crash_progress FROM job"
                                " WHERE state = 'RUNNING' AND owner = $1 ORDER BY sequence"),
                   {owner})) {
        PlanningJob job = ToJob(orphan);
        const bool advanced = orphan.Int(21) != 0;
        if (PutBack(sql, &job, true, advanced)) ++requeued;
      }
    }
    return requeued;
  });
}

absl::StatusOr<Recipe> SqlJobStore::GetRecipe(const std::string& client,
                                              const std::string& recipe_id) {
  const absl::Status names = CheckNames({{"client", client}, {"recipe_id", recipe_id}}, {});
  if (!names.ok()) return names;
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<Recipe> {
    const SqlRows rows =
        sql.Run("SELECT kind, fingerprint, task FROM recipe WHERE client = $1 AND recipe_id = $2",
                {client, recipe_id});
    if (rows.empty()) {
      return WithErrorInfo(absl::NotFoundError(absl::StrCat("no recipe \"", recipe_id, "\"")),
                           "RECIPE_UNKNOWN");
    }
    return Recipe{client,
                  recipe_id,
                  rows.front().Text(0),
                  rows.front().Text(1),
                  rows.front().Bytes(2),
                  FilesOf(sql, {client, "recipe", recipe_id})};
  });
}

absl::Status SqlJobStore::PutRecipe(const Recipe& recipe, const ClientQuota& quota) {
  const absl::Status names = CheckNames({{"client", recipe.client},
                                         {"recipe_id", recipe.recipe_id},
                                         {"kind", recipe.kind},
                                         {"fingerprint", recipe.fingerprint}},
                                        recipe.files);
  if (!names.ok()) return names;
  return Write([&](SqlTransaction& sql) -> absl::Status {
    sql.Run("DELETE FROM recipe WHERE client = $1 AND recipe_id = $2",
            {recipe.client, recipe.recipe_id});
    sql.Run(
        "INSERT INTO recipe (client, recipe_id, kind, fingerprint, task)"
        " VALUES ($1, $2, $3, $4, $5)",
        {recipe.client, recipe.recipe_id, recipe.kind, recipe.fingerprint, SqlBytes{recipe.task}});
    ReplaceFiles(sql, {recipe.client, "recipe", recipe.recipe_id}, recipe.files);
    return CheckStoredBytes(sql, recipe.client, quota);
  });
}

absl::Status SqlJobStore::DeleteRecipe(const std::string& client, const std::string& recipe_id) {
  const absl::Status names = CheckNames({{"client", client}, {"recipe_id", recipe_id}}, {});
  if (!names.ok()) return names;
  return Write([&](SqlTransaction& sql) -> absl::Status {
    sql.Run("DELETE FROM recipe WHERE client = $1 AND recipe_id = $2", {client, recipe_id});
    ReplaceFiles(sql, {client, "recipe", recipe_id}, {});
    return absl::OkStatus();
  });
}

absl::StatusOr<int> SqlJobStore::CountRecipes(const std::string& client) {
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<int> {
    const SqlRows rows = sql.Run("SELECT COUNT(*) FROM recipe WHERE client = $1", {client});
    return rows.empty() ? 0 : static_cast<int>(rows.front().Int(0));
  });
}

absl::Status SqlJobStore::AddUpload(const std::string& client, const JobFile& file,
                                    const ClientQuota& quota) {
  if (const absl::Status names = CheckNames({{"client", client}}, {file}); !names.ok()) {
    return names;
  }
  return Write([&](SqlTransaction& sql) -> absl::Status {
    const bool held = !sql.Run("SELECT 1 FROM named_file WHERE client = $1 AND digest = $2 LIMIT 1",
                               {client, file.digest})
                           .empty();
    ReplaceFiles(sql, {client, "upload", file.digest}, {file});
    // What the client holds already takes no more room.
    return held ? absl::OkStatus() : CheckStoredBytes(sql, client, quota);
  });
}

absl::StatusOr<std::optional<int64_t>> SqlJobStore::FindFile(const std::string& client,
                                                             const std::string& digest) {
  if (!IsPlainText(client) || !IsPlainText(digest)) return std::nullopt;
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<std::optional<int64_t>> {
    const SqlRows rows =
        sql.Run("SELECT size_bytes FROM named_file WHERE client = $1 AND digest = $2 LIMIT 1",
                {client, digest});
    if (rows.empty()) return std::nullopt;
    return rows.front().Int(0);
  });
}

absl::StatusOr<std::vector<JobEvent>> SqlJobStore::Events(int64_t after_sequence,
                                                          const std::optional<std::string>& job_id,
                                                          int limit) {
  if (job_id && !IsPlainText(*job_id)) return std::vector<JobEvent>{};
  std::vector<SqlValue> parameters = {after_sequence, int64_t{std::clamp(limit, 1, kMaxRows)}};
  if (job_id) parameters.emplace_back(*job_id);
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<std::vector<JobEvent>> {
    std::vector<JobEvent> events;
    std::map<int64_t, size_t> places;
    for (const SqlRow& row :
         sql.Run(absl::StrCat("SELECT sequence, type, time_us, job_id, client, kind, state,"
                              " progress, message, failure_code, failure_reason, failure_message,"
                              " revision, request_id, priority, attempts FROM event"
                              " WHERE sequence > $1",
                              job_id ? " AND job_id = $3" : "", " ORDER BY sequence LIMIT $2"),
                 parameters)) {
      JobEvent event;
      event.sequence = row.Int(0);
      event.type = row.Text(1);
      event.time = ToTime(row.Int(2));
      event.job.job_id = row.Text(3);
      event.job.client = row.Text(4);
      event.job.kind = row.Text(5);
      event.job.state = ToState(row.Text(6));
      event.job.progress = row.Real(7);
      event.job.message = row.Text(8);
      event.job.failure = {static_cast<absl::StatusCode>(row.Int(9)), row.Text(10), row.Text(11)};
      event.job.revision = row.Int(12);
      event.job.request_id = row.Text(13);
      event.job.priority = static_cast<int>(row.Int(14));
      event.job.attempts = static_cast<int>(row.Int(15));
      places[event.sequence] = events.size();
      events.push_back(std::move(event));
    }
    if (events.empty()) return events;
    std::vector<SqlValue> range = {events.front().sequence, events.back().sequence};
    if (job_id) range.emplace_back(*job_id);
    for (const SqlRow& row :
         sql.Run(absl::StrCat("SELECT event_sequence, name, digest, size_bytes FROM event_result"
                              " JOIN event ON event.sequence = event_sequence"
                              " WHERE event_sequence >= $1 AND event_sequence <= $2",
                              job_id ? " AND event.job_id = $3" : "",
                              " ORDER BY event_sequence, place"),
                 range)) {
      const auto place = places.find(row.Int(0));
      if (place != places.end()) events[place->second].job.results.push_back(ToFile(row, 1));
    }
    return events;
  });
}

void SqlJobStore::WaitForEvent(int64_t after_sequence, absl::Duration timeout) {
  const auto end = EndOf(timeout);
  while (true) {
    const int64_t seen = Changes();
    const auto last = Read([](SqlTransaction& sql) -> absl::StatusOr<int64_t> {
      const SqlRows rows = sql.Run("SELECT value FROM counter WHERE name = 'event'");
      return rows.empty() ? 0 : rows.front().Int(0);
    });
    if ((last.ok() && *last > after_sequence) || steady_clock::now() >= end) return;
    AwaitChange(seen, end);
  }
}

absl::StatusOr<int64_t> SqlJobStore::EventCursor(const std::string& receiver) {
  if (const absl::Status names = CheckNames({{"receiver", receiver}}, {}); !names.ok()) {
    return names;
  }
  // From here on the receiver is known, and events wait for it.
  return Write([&](SqlTransaction& sql) -> absl::StatusOr<int64_t> {
    sql.Run("INSERT INTO receiver (name, sequence) VALUES ($1, 0) ON CONFLICT (name) DO NOTHING",
            {receiver});
    const SqlRows rows = sql.Run("SELECT sequence FROM receiver WHERE name = $1", {receiver});
    return rows.empty() ? 0 : rows.front().Int(0);
  });
}

absl::Status SqlJobStore::SetEventCursor(const std::string& receiver, int64_t sequence) {
  if (const absl::Status names = CheckNames({{"receiver", receiver}}, {}); !names.ok()) {
    return names;
  }
  // A late word of one that held the receiver before does not turn the cursor back.
  return Write([&](SqlTransaction& sql) -> absl::Status {
    sql.Run(
        "INSERT INTO receiver (name, sequence) VALUES ($1, $2) ON CONFLICT (name) DO UPDATE"
        " SET sequence = excluded.sequence WHERE receiver.sequence < excluded.sequence",
        {receiver, sequence});
    return absl::OkStatus();
  });
}

bool SqlJobStore::HoldsReceiver(const std::string& receiver) {
  return database_->Holds(absl::StrCat("receiver/", receiver));
}

absl::Status SqlJobStore::AdvanceServiceTime(absl::Duration by) {
  if (by < absl::ZeroDuration() || by > kLongestWait) {
    return absl::InvalidArgumentError(absl::StrCat("service time advances by 0 to ",
                                                   absl::FormatDuration(kLongestWait), ", not by ",
                                                   absl::FormatDuration(by)));
  }
  // Of several processes one counts: time would else run as many times as fast.
  if (!database_->Holds("service_time")) return absl::OkStatus();
  return Write([&](SqlTransaction& sql) -> absl::Status {
    sql.Run("UPDATE counter SET value = value + $1 WHERE name = 'service_us'",
            {absl::ToInt64Microseconds(by)});
    return absl::OkStatus();
  });
}

absl::StatusOr<int> SqlJobStore::RemoveOlderThan(absl::Duration age) {
  const int64_t age_us =
      absl::ToInt64Microseconds(std::clamp(age, absl::ZeroDuration(), 100 * kLongestWait));
  return Write([&](SqlTransaction& sql) -> absl::StatusOr<int> {
    const SqlRows now = sql.Run(absl::StrCat("SELECT ", kServiceTime));
    const int64_t limit_us = (now.empty() ? 0 : now.front().Int(0)) - age_us;
    const std::string old =
        absl::StrCat("state IN ", kFinishedStates, " AND finished_service_us < $1");
    sql.Run(absl::StrCat("DELETE FROM named_file WHERE holder IN ('file', 'result')"
                         " AND holder_id IN (SELECT job_id FROM job WHERE ",
                         old, ")"),
            {limit_us});
    const SqlRows removed =
        sql.Run(absl::StrCat("DELETE FROM job WHERE ", old, " RETURNING job_id"), {limit_us});
    sql.Run(
        "DELETE FROM named_file WHERE holder = 'upload' AND made_service_us < $1"
        " AND NOT EXISTS (SELECT 1 FROM named_file AS other WHERE other.client ="
        " named_file.client AND other.digest = named_file.digest AND other.holder <> 'upload')",
        {limit_us});
    sql.Run(
        "DELETE FROM event WHERE made_service_us < $1 AND (made_service_us < $2 OR NOT EXISTS"
        " (SELECT 1 FROM receiver WHERE receiver.sequence < event.sequence))",
        {limit_us, limit_us - age_us});
    return static_cast<int>(removed.size());
  });
}

absl::StatusOr<std::set<std::string>> SqlJobStore::NamedDigests() {
  return Read([](SqlTransaction& sql) -> absl::StatusOr<std::set<std::string>> {
    std::set<std::string> digests;
    for (const SqlRow& row : sql.Run("SELECT DISTINCT digest FROM named_file")) {
      digests.insert(row.Text(0));
    }
    return digests;
  });
}

}  // namespace

absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenSqlJobStore(
    std::unique_ptr<SqlDatabase> database, SteadyClock clock) {
  auto writer = database->Connect();
  if (!writer.ok()) return writer.status();
  auto reader = database->Connect();
  if (!reader.ok()) return reader.status();
  if (absl::Status begun = (*writer)->Begin(SqlAccess::kWrite); !begun.ok()) return begun;
  SqlTransaction sql(writer->get());
  absl::Status migrated = MigrateJobSchema(database->Name(), &sql);
  if (migrated.ok()) migrated = (*writer)->Commit();
  if (!migrated.ok()) {
    (*writer)->Rollback();
    return migrated;
  }
  return std::make_unique<SqlJobStore>(std::move(database), *std::move(writer), *std::move(reader),
                                       std::move(clock));
}

absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenSqliteJobStore(const std::string& file) {
  auto database = OpenSqliteDatabase(file);
  if (!database.ok()) return database.status();
  return OpenSqlJobStore(*std::move(database));
}

absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenPostgresJobStore(
    const std::string& connection) {
  auto database = OpenPostgresDatabase(connection);
  if (!database.ok()) return database.status();
  return OpenSqlJobStore(*std::move(database));
}

}  // namespace sightline
