// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/sqlite_database.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <map>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planning_service/job_store/random_number.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

// Longest wait for another program that reads or copies the file.
constexpr int kBusyTimeoutMs = 10'000;
// Limit, because texts that depend on the number of values would accumulate.
constexpr size_t kMaxKeptStatements = 200;

struct CloseDatabase {
  void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
};
struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using DatabaseHandle = std::unique_ptr<sqlite3, CloseDatabase>;
using StatementHandle = std::unique_ptr<sqlite3_stmt, FinalizeStatement>;

absl::Status SqliteError(sqlite3* database, int code, const std::string& file) {
  const std::string message =
      absl::StrCat(file, ": ", database ? sqlite3_errmsg(database) : sqlite3_errstr(code));
  const int system_error = database ? sqlite3_system_errno(database) : 0;
  const bool no_room = system_error == ENOSPC || system_error == EDQUOT;
  switch (code & 0xff) {
    case SQLITE_FULL:
      return WithErrorInfo(absl::ResourceExhaustedError(message), "DISK_FULL");
    case SQLITE_IOERR:
    case SQLITE_CANTOPEN:
      if (no_room) return WithErrorInfo(absl::ResourceExhaustedError(message), "DISK_FULL");
      return absl::UnavailableError(message);
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_PROTOCOL:
    case SQLITE_INTERRUPT:
      return absl::UnavailableError(message);
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return absl::DataLossError(message);
    case SQLITE_NOMEM:
      return absl::ResourceExhaustedError(message);
    case SQLITE_READONLY:
    case SQLITE_PERM:
    case SQLITE_AUTH:
      return absl::PermissionDeniedError(message);
    case SQLITE_TOOBIG:
      return absl::InvalidArgumentError(message);
    default:
      return absl::InternalError(message);
  }
}

class SqliteConnection : public SqlConnection {
 public:
  static absl::StatusOr<std::unique_ptr<SqliteConnection>> Open(const std::string& file) {
    sqlite3* opened = nullptr;
    const int code = sqlite3_open_v2(
        file.c_str(), &opened,
        SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE,
        nullptr);
    DatabaseHandle database(opened);
    if (code != SQLITE_OK) return SqliteError(opened, code, file);
    sqlite3_busy_timeout(opened, kBusyTimeoutMs);
    auto connection =
        std::unique_ptr<SqliteConnection>(new SqliteConnection(file, std::move(database)));
    // With synchronous=FULL a commit is on disk when it returns, in WAL mode too.
    for (const char* pragma :
         {"PRAGMA journal_mode = WAL", "PRAGMA synchronous = FULL", "PRAGMA foreign_keys = ON"}) {
      SIGHTLINE_RETURN_IF_ERROR(connection->Run(pragma, {}).status());
    }
    return connection;
  }

  absl::Status Begin(SqlAccess access) override {
    return Run(access == SqlAccess::kWrite ? "BEGIN IMMEDIATE" : "BEGIN", {}).status();
  }

  absl::Status Commit() override { return Run("COMMIT", {}).status(); }

  void Rollback() override {
    // Some errors, e.g. a full disk, have ended the transaction already.
    if (sqlite3_get_autocommit(database_.get()) == 0) Run("ROLLBACK", {}).IgnoreError();
  }

  absl::StatusOr<SqlRows> Run(const std::string& sql,
                              const std::vector<SqlValue>& parameters) override {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto statement, Prepare(sql));
    auto rows = Execute(statement, parameters);
    // Releases the lock and the values that the statement holds.
    sqlite3_reset(statement);
    sqlite3_clear_bindings(statement);
    return rows;
  }

 private:
  SqliteConnection(std::string file, DatabaseHandle database)
      : file_(std::move(file)), database_(std::move(database)) {}

  // Clients read this message, so it does not name the path of the file.
  absl::Status Error(int code) const {
    return SqliteError(database_.get(), code, std::filesystem::path(file_).filename().string());
  }

  absl::StatusOr<sqlite3_stmt*> Prepare(const std::string& sql) {
    const auto known = statements_.find(sql);
    if (known != statements_.end()) return known->second.get();
    sqlite3_stmt* prepared = nullptr;
    const int code = sqlite3_prepare_v3(database_.get(), sql.data(), static_cast<int>(sql.size()),
                                        SQLITE_PREPARE_PERSISTENT, &prepared, nullptr);
    StatementHandle statement(prepared);
    if (code != SQLITE_OK) return Error(code);
    if (statements_.size() >= kMaxKeptStatements) statements_.clear();
    return statements_.emplace(sql, std::move(statement)).first->second.get();
  }

  absl::StatusOr<SqlRows> Execute(sqlite3_stmt* statement,
                                  const std::vector<SqlValue>& parameters) {
    for (size_t i = 0; i < parameters.size(); ++i) {
      // SQLite takes "$1" for a name; its index is the order of first occurrence.
      const int index = sqlite3_bind_parameter_index(statement, absl::StrCat("$", i + 1).c_str());
      if (index == 0) return absl::InternalError(absl::StrCat("parameter ", i + 1, " is unused"));
      if (const int code = Bind(statement, index, parameters[i]); code != SQLITE_OK) {
        return Error(code);
      }
    }
    SqlRows rows;
    while (true) {
      const int code = sqlite3_step(statement);
      if (code == SQLITE_DONE) return rows;
      if (code != SQLITE_ROW) return Error(code);
      std::vector<SqlValue> values;
      for (int i = 0; i < sqlite3_column_count(statement); ++i) {
        values.push_back(Column(statement, i));
      }
      rows.emplace_back(std::move(values));
    }
  }

  // Values outlive the step, so they need not be copied.
  static int Bind(sqlite3_stmt* statement, int index, const SqlValue& value) {
    if (const auto* whole = std::get_if<int64_t>(&value)) {
      return sqlite3_bind_int64(statement, index, *whole);
    }
    if (const auto* real = std::get_if<double>(&value)) {
      return sqlite3_bind_double(statement, index, *real);
    }
    if (const auto* text = std::get_if<std::string>(&value)) {
      return sqlite3_bind_text64(statement, index, text->data(), text->size(), SQLITE_STATIC,
                                 SQLITE_UTF8);
    }
    const std::string& bytes = std::get<SqlBytes>(value).bytes;
    return sqlite3_bind_blob64(statement, index, bytes.data(), bytes.size(), SQLITE_STATIC);
  }

  static SqlValue Column(sqlite3_stmt* statement, int index) {
    switch (sqlite3_column_type(statement, index)) {
      case SQLITE_INTEGER:
        return static_cast<int64_t>(sqlite3_column_int64(statement, index));
      case SQLITE_FLOAT:
        return sqlite3_column_double(statement, index);
      case SQLITE_TEXT: {
        const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement, index));
        return std::string(text, sqlite3_column_bytes(statement, index));
      }
      default: {
        // An empty blob is a null pointer.
        const auto* bytes = static_cast<const char*>(sqlite3_column_blob(statement, index));
        return SqlBytes{bytes ? std::string(bytes, sqlite3_column_bytes(statement, index)) : ""};
      }
    }
  }

  const std::string file_;
  DatabaseHandle database_;
  std::map<std::string, StatementHandle> statements_;  // go before the database
};

class SqliteDatabase : public SqlDatabase {
 public:
  // Takes over the descriptor of the lock file.
  SqliteDatabase(std::string file, int lock)
      : file_(std::move(file)), lock_(lock), owner_(static_cast<int64_t>(RandomBits() >> 1)) {}
  ~SqliteDatabase() override { close(lock_); }
  SqliteDatabase(const SqliteDatabase&) = delete;
  SqliteDatabase& operator=(const SqliteDatabase&) = delete;

  absl::StatusOr<std::unique_ptr<SqlConnection>> Connect() override {
    return SqliteConnection::Open(file_);
  }
  bool IsShared() const override { return false; }
  // The time of creation distinguishes a new file from an old one with the same inode.
  absl::StatusOr<std::string> Instance(SqlConnection*) override {
    struct statx about = {};
    if (statx(AT_FDCWD, file_.c_str(), 0, STATX_INO | STATX_BTIME, &about) != 0) {
      return absl::ErrnoToStatus(errno, absl::StrCat(file_, ": its inode cannot be read"));
    }
    const bool has_birth_time = (about.stx_mask & STATX_BTIME) != 0;
    return absl::StrCat("inode ", about.stx_ino, " of ",
                        has_birth_time ? about.stx_btime.tv_sec : 0, ".",
                        has_birth_time ? about.stx_btime.tv_nsec : 0);
  }
  std::string Name() const override { return file_; }
  absl::StatusOr<int64_t> Owner() override { return owner_; }
  // The lock file lets one owner live at a time.
  absl::StatusOr<bool> IsOwnerGone(SqlConnection*, int64_t owner) override {
    return owner != owner_;
  }
  bool Holds(const std::string&) override { return true; }

 private:
  const std::string file_;
  const int lock_;
  const int64_t owner_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenSqliteDatabase(const std::string& file) {
  // Resolves links, so that two names of one file have the same lock.
  std::error_code error;
  const std::filesystem::path canonical = std::filesystem::weakly_canonical(file, error);
  const std::string path = error ? file : canonical.string();
  const std::string lock_file = path + ".lock";
  const int lock = open(lock_file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock < 0) {
    const int code = errno;
    const absl::Status status =
        absl::ErrnoToStatus(code, absl::StrCat(lock_file, ": cannot be opened"));
    return code == ENOSPC || code == EDQUOT
               ? WithErrorInfo(absl::ResourceExhaustedError(status.message()), "DISK_FULL")
               : status;
  }
  if (flock(lock, LOCK_EX | LOCK_NB) != 0) {
    close(lock);
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": another process has it open (it holds the lock of ", lock_file, ")"));
  }
  auto database = std::make_unique<SqliteDatabase>(path, lock);
  SIGHTLINE_ASSIGN_OR_RETURN(auto connection, database->Connect());
  // Finds damaged pages now; otherwise they would show only when their jobs are read.
  SIGHTLINE_ASSIGN_OR_RETURN(const auto check, connection->Run("PRAGMA quick_check(1)", {}));
  if (check.size() != 1 || check.front().Text(0) != "ok") {
    return absl::DataLossError(absl::StrCat(
        path, ": the database is damaged: ", check.empty() ? "" : check.front().Text(0)));
  }
  return database;
}

absl::Status CopySqliteDatabase(const std::string& file, const std::string& to) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    return absl::NotFoundError(absl::StrCat(file, ": there is no such database"));
  }
  const std::string part = to + ".part";
  std::filesystem::remove(part, error);
  sqlite3* from_opened = nullptr;
  sqlite3* to_opened = nullptr;
  // Not opened read-only: readers of a database with a write-ahead log write to its index.
  const int from_code =
      sqlite3_open_v2(file.c_str(), &from_opened,
                      SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE, nullptr);
  const DatabaseHandle from(from_opened);
  if (from_code != SQLITE_OK) return SqliteError(from_opened, from_code, file);
  const int to_code = sqlite3_open_v2(
      part.c_str(), &to_opened,
      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE,
      nullptr);
  DatabaseHandle copy(to_opened);
  if (to_code != SQLITE_OK) return SqliteError(to_opened, to_code, part);
  sqlite3_busy_timeout(from_opened, kBusyTimeoutMs);
  sqlite3_backup* backup = sqlite3_backup_init(to_opened, "main", from_opened, "main");
  if (backup == nullptr) return SqliteError(to_opened, sqlite3_errcode(to_opened), part);
  // Copies all pages in one step, which is a single reading transaction.
  sqlite3_backup_step(backup, -1);
  const int code = sqlite3_backup_finish(backup);
  copy.reset();
  absl::Status status = code == SQLITE_OK ? absl::OkStatus() : SqliteError(nullptr, code, file);
  if (status.ok() && rename(part.c_str(), to.c_str()) != 0) {
    status = absl::ErrnoToStatus(errno, absl::StrCat(to, ": cannot be made"));
  }
  if (!status.ok()) std::filesystem::remove(part, error);
  return status;
}

}  // namespace sightline
