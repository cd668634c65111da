// SPDX-License-Identifier: Apache-2.0
// Interface to the SQL databases that the job store supports, so that its logic is written once.
//
// Statements must be valid in both SQLite and PostgreSQL and have parameters $1, $2, …. No column
// and no value is ever NULL.
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

  // Value of a column, counted from 0. If the value has another type, which only happens in a
  // damaged database, the result is zero or empty.
  int64_t Int(size_t column) const { return Get<int64_t>(column); }
  // A real number; whole numbers are converted.
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

// For one thread at a time. Errors of all methods: UNAVAILABLE (connection lost, or busy for too
// long), RESOURCE_EXHAUSTED with reason DISK_FULL, DATA_LOSS.
class SqlConnection {
 public:
  virtual ~SqlConnection() = default;
  // Begins a transaction; reconnects first if the connection is lost. A reading transaction sees
  // one state throughout. Writing transactions of all processes run one after the other.
  virtual absl::Status Begin(SqlAccess access) = 0;
  virtual absl::StatusOr<SqlRows> Run(const std::string& sql,
                                      const std::vector<SqlValue>& parameters) = 0;
  // UNAVAILABLE: the transaction may have been committed or not.
  virtual absl::Status Commit() = 0;
  // Does nothing if no transaction is open.
  virtual void Rollback() = 0;
};

// Thread-safe.
class SqlDatabase {
 public:
  virtual ~SqlDatabase() = default;
  virtual absl::StatusOr<std::unique_ptr<SqlConnection>> Connect() = 0;
  // True if other processes may write to the database.
  virtual bool IsShared() const = 0;
  // Identifies the storage of the tables: the text stays the same at every start and changes if a
  // dump, the file or the server is restored. `connection` is in a transaction.
  virtual absl::StatusOr<std::string> Instance(SqlConnection* connection) = 0;
  // Name for messages: the file, or database and host.
  virtual std::string Name() const = 0;

  // Number of this object as owner of jobs. It changes once the database may consider the earlier
  // number dead.
  virtual absl::StatusOr<int64_t> Owner() = 0;
  // True if the owner of that number does not live any more. To be called within a writing
  // transaction of `connection`; true stays valid until its end.
  virtual absl::StatusOr<bool> IsOwnerGone(SqlConnection* connection, int64_t owner) = 0;
  // True for one of all objects that share the database: it holds the role until it is destroyed or
  // its connection is lost.
  virtual bool Holds(const std::string& role) = 0;
};

// Runs statements of a transaction. After the first error, further statements do nothing and
// return no rows, so callers check `status` only once at the end.
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
