// SPDX-License-Identifier: Apache-2.0
// The part of SQL databases that the job store needs, so that its logic is written once.
//
// Statements are those that SQLite and PostgreSQL both understand, with parameters $1, $2, …; no
// column and no value is ever NULL.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {

// Bytes that are not text.
struct SqlBytes {
  std::string bytes;
};

using SqlValue = std::variant<int64_t, double, std::string, SqlBytes>;

class SqlRow {
 public:
  explicit SqlRow(std::vector<SqlValue> values) : values_(std::move(values)) {}

  // Value of a column, from 0. Of another type than asked for, as only a damaged database gives it,
  // it is zero or empty.
  int64_t Int(size_t column) const { return Get<int64_t>(column); }
  // Whole numbers count as real ones.
  double Real(size_t column) const {
    const bool whole = column < values_.size() && std::holds_alternative<int64_t>(values_[column]);
    return whole ? static_cast<double>(Int(column)) : Get<double>(column);
  }
  std::string Text(size_t column) const { return Get<std::string>(column); }
  std::string Bytes(size_t column) const { return Get<SqlBytes>(column).bytes; }

 private:
  template <typename T>
  T Get(size_t column) const {
    const T* value = column < values_.size() ? std::get_if<T>(&values_[column]) : nullptr;
    return value ? *value : T();
  }

  std::vector<SqlValue> values_;
};

using SqlRows = std::vector<SqlRow>;

enum class SqlAccess { kRead, kWrite };

// Used by one thread at a time. Errors of all: UNAVAILABLE (connection lost, or busy for too long),
// RESOURCE_EXHAUSTED with reason DISK_FULL, DATA_LOSS.
class SqlConnection {
 public:
  virtual ~SqlConnection() = default;
  // Reading transactions see one state throughout. Writing ones run one after the other, in all
  // processes. Connects anew first if the connection is gone.
  virtual absl::Status Begin(SqlAccess access) = 0;
  virtual absl::StatusOr<SqlRows> Run(const std::string& sql,
                                      const std::vector<SqlValue>& parameters) = 0;
  // UNAVAILABLE: it may have happened.
  virtual absl::Status Commit() = 0;
  // Does nothing if no transaction is open.
  virtual void Rollback() = 0;
};

// Thread-safe.
class SqlDatabase {
 public:
  virtual ~SqlDatabase() = default;
  virtual absl::StatusOr<std::unique_ptr<SqlConnection>> Connect() = 0;
  // Whether other processes may write to it.
  virtual bool IsShared() const = 0;
  // Identifies the place of the tables: the same text at every start, another one after a restore
  // from a dump, of the file or of the server. `connection` is in a transaction.
  virtual absl::StatusOr<std::string> Instance(SqlConnection* connection) = 0;
  // For messages: file, or database and host.
  virtual std::string Name() const = 0;

  // Number of this object as owner of jobs. It is another one once the database may have taken the
  // one before for dead.
  virtual absl::StatusOr<int64_t> Owner() = 0;
  // Whether the owner of that number lives no more. Called inside a writing transaction of
  // `connection`; true holds until its end.
  virtual absl::StatusOr<bool> IsOwnerGone(SqlConnection* connection, int64_t owner) = 0;
  // True for one living object of all that share the database; it stays so until it ends or its
  // connection is lost.
  virtual bool Holds(const std::string& role) = 0;
};

// Statements of a transaction. After the first error the others do nothing and give no rows, so
// that callers look at `status` once at the end.
class SqlTransaction {
 public:
  explicit SqlTransaction(SqlConnection* connection) : connection_(connection) {}

  SqlRows Run(const std::string& sql, const std::vector<SqlValue>& parameters = {}) {
    if (!status_.ok()) return {};
    auto rows = connection_->Run(sql, parameters);
    if (rows.ok()) return *std::move(rows);
    status_ = rows.status();
    return {};
  }
  void Fail(const absl::Status& status) { status_.Update(status); }
  const absl::Status& status() const { return status_; }
  SqlConnection* connection() { return connection_; }

 private:
  SqlConnection* connection_;
  absl::Status status_;
};

}  // namespace sightline
