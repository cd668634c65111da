// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/postgres_database.h"

#include <endian.h>
#include <libpq-fe.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cstring>
#include <memory>
#include <mutex>
#include <set>
#include <type_traits>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/digest/sha256.h"
#include "core/status/status_macros.h"
#include "planning_service/job_store/random_number.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

using std::chrono::steady_clock;

// Types by their numbers in pg_type, which never change.
constexpr Oid kBool = 16;
constexpr Oid kBytea = 17;
constexpr Oid kInt8 = 20;
constexpr Oid kInt4 = 23;
constexpr Oid kText = 25;
constexpr Oid kFloat8 = 701;

// Advisory lock of the writer: "sightlin" in ASCII.
constexpr int64_t kWriteLock = 0x73696768746c696e;

constexpr auto kFirstBackoff = std::chrono::milliseconds(100);
constexpr auto kLongestBackoff = std::chrono::milliseconds(5000);

// Limits on statements, on waits for the lock and on idle transactions, so that a process that
// stopped within a transaction does not block the others for ever. The server notices hosts that
// vanished. Commits are synchronous even if the server is set otherwise.
constexpr char kSessionSettings[] =
    "SET search_path TO sightline, pg_temp;"
    "SET statement_timeout = '30s';"
    "SET idle_in_transaction_session_timeout = '30s';"
    "SELECT set_config(name, '0', false) FROM pg_settings WHERE name = 'idle_session_timeout';"
    "SET tcp_keepalives_idle = 10;"
    "SET tcp_keepalives_interval = 5;"
    "SET tcp_keepalives_count = 3;"
    "SELECT set_config('synchronous_commit', 'on', false)"
    " WHERE current_setting('synchronous_commit') = 'off'";

struct FinishConnection {
  void operator()(PGconn* connection) const { PQfinish(connection); }
};
struct ClearResult {
  void operator()(PGresult* result) const { PQclear(result); }
};
using ConnectionHandle = std::unique_ptr<PGconn, FinishConnection>;
using ResultHandle = std::unique_ptr<PGresult, ClearResult>;

// Numbers are transferred with their highest byte first.
template <typename T>
T FromWire(const void* bytes) {
  static_assert(sizeof(T) == 4 || sizeof(T) == 8);
  std::conditional_t<sizeof(T) == 4, uint32_t, uint64_t> number = 0;
  std::memcpy(&number, bytes, sizeof(T));
  if constexpr (sizeof(T) == 4) {
    return std::bit_cast<T>(be32toh(number));
  } else {
    return std::bit_cast<T>(be64toh(number));
  }
}

template <typename T>
std::string ToWire(T value) {
  static_assert(sizeof(T) == 8);
  const uint64_t number = htobe64(std::bit_cast<uint64_t>(value));
  return std::string(reinterpret_cast<const char*>(&number), sizeof(number));
}

std::string OneLine(const char* message) {
  std::string line = message ? message : "";
  std::replace(line.begin(), line.end(), '\n', ' ');
  return std::string(absl::StripAsciiWhitespace(line));
}

// True if the statement failed because its connection was lost. Errors of the server have a
// SQLSTATE; libpq may report a lost connection by its message alone.
bool IsConnectionLost(PGconn* connection, const PGresult* result) {
  if (PQstatus(connection) != CONNECTION_OK || result == nullptr) return true;
  const char* severity = PQresultErrorField(result, PG_DIAG_SEVERITY_NONLOCALIZED);
  return PQresultErrorField(result, PG_DIAG_SQLSTATE) == nullptr ||
         (severity != nullptr && absl::string_view(severity) != "ERROR");
}

// The reason why there is no connection, with host and database. The message may reach clients, so
// it leaves out the rest of the connection text, which may hold a password; libpq repeats that text
// if it cannot parse it.
std::string CannotConnect(const std::string& connection_text, const char* reason) {
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> options(
      PQconninfoParse(connection_text.c_str(), nullptr), &PQconninfoFree);
  std::string host, database, shown = OneLine(reason);
  if (options == nullptr && connection_text.find_first_of("=:/") != std::string::npos) {
    return "PostgreSQL: the connection text cannot be read; it must be that of libpq, such as "
           "\"host=/run/postgresql dbname=sightline\"";
  }
  for (const PQconninfoOption* option = options.get();
       option != nullptr && option->keyword != nullptr; ++option) {
    if (option->val == nullptr || *option->val == '\0') continue;
    const absl::string_view keyword = option->keyword;
    if (keyword == "host" || (keyword == "hostaddr" && host.empty())) host = option->val;
    if (keyword == "dbname") database = option->val;
    // libpq marks secrets with "*".
    if (absl::string_view(option->dispchar) == "*") {
      shown = absl::StrReplaceAll(shown, {{option->val, "***"}});
    }
  }
  return absl::StrCat("PostgreSQL: cannot connect to database \"", database, "\"",
                      host.empty() ? "" : absl::StrCat(" at ", host), ": ", shown);
}

// Error of a statement.
absl::Status PostgresError(PGconn* connection, const PGresult* result) {
  const char* field = result ? PQresultErrorField(result, PG_DIAG_SQLSTATE) : nullptr;
  const std::string state = field ? field : "";
  const std::string message =
      absl::StrCat("PostgreSQL: ", OneLine(PQerrorMessage(connection)),
                   state.empty() ? "" : absl::StrCat(" (SQLSTATE ", state, ")"));
  if (state == "53100") return WithErrorInfo(absl::ResourceExhaustedError(message), "DISK_FULL");
  if (state == "53200") return absl::ResourceExhaustedError(message);
  if (state == "XX001" || state == "XX002") return absl::DataLossError(message);
  if (state == "22021" || state == "22P05" || state == "54000") {
    return absl::InvalidArgumentError(message);
  }
  if (state == "42501" || state == "28000" || state == "28P01") {
    return absl::PermissionDeniedError(message);
  }
  // SQLSTATE classes: connections, resources, shutdown, conflicts, standby, timeouts, disk errors.
  for (const char* prefix : {"08", "53", "57", "40", "25006", "25P03", "55P03", "58030"}) {
    if (absl::StartsWith(state, prefix)) return absl::UnavailableError(message);
  }
  if (IsConnectionLost(connection, result)) return absl::UnavailableError(message);
  return absl::InternalError(message);
}

SqlValue ToValue(const PGresult* result, int row, int column) {
  const char* value = PQgetvalue(result, row, column);
  switch (PQftype(result, column)) {
    case kBool:
      return int64_t{*value != 0};
    case kInt4:
      return int64_t{FromWire<int32_t>(value)};
    case kInt8:
      return FromWire<int64_t>(value);
    case kFloat8:
      return FromWire<double>(value);
    case kBytea:
      return SqlBytes{std::string(value, PQgetlength(result, row, column))};
    default:
      return std::string(value, PQgetlength(result, row, column));
  }
}

// A connection that reopens itself after it was lost.
class PostgresConnection : public SqlConnection {
 public:
  explicit PostgresConnection(std::string connection_text)
      : connection_text_(std::move(connection_text)) {}

  absl::Status Begin(SqlAccess access) override {
    // The connection may have been lost since its last use, so the beginning is tried once more. A
    // second loss is reported.
    absl::Status begun = TryBegin(access);
    if (absl::IsUnavailable(begun) && was_connected_) begun = TryBegin(access);
    return begun;
  }

  absl::StatusOr<SqlRows> Run(const std::string& sql,
                              const std::vector<SqlValue>& parameters) override {
    if (!connection_) return absl::UnavailableError("PostgreSQL: not connected");
    std::vector<Oid> types;
    std::vector<std::string> numbers(parameters.size());
    std::vector<const char*> values;
    std::vector<int> lengths;
    const std::vector<int> formats(parameters.size(), 1);
    for (size_t i = 0; i < parameters.size(); ++i) {
      const std::string* bytes = &numbers[i];
      if (const auto* whole = std::get_if<int64_t>(&parameters[i])) {
        types.push_back(kInt8);
        numbers[i] = ToWire(*whole);
      } else if (const auto* real = std::get_if<double>(&parameters[i])) {
        types.push_back(kFloat8);
        numbers[i] = ToWire(*real);
      } else if (const auto* text = std::get_if<std::string>(&parameters[i])) {
        types.push_back(kText);
        bytes = text;
      } else {
        types.push_back(kBytea);
        bytes = &std::get<SqlBytes>(parameters[i]).bytes;
      }
      values.push_back(bytes->data());
      lengths.push_back(static_cast<int>(bytes->size()));
    }
    const ResultHandle result(PQexecParams(connection_.get(), sql.c_str(),
                                           static_cast<int>(parameters.size()), types.data(),
                                           values.data(), lengths.data(), formats.data(), 1));
    const ExecStatusType status = PQresultStatus(result.get());
    if (status != PGRES_TUPLES_OK && status != PGRES_COMMAND_OK) {
      absl::Status error = PostgresError(connection_.get(), result.get());
      if (IsConnectionLost(connection_.get(), result.get())) connection_.reset();
      return error;
    }
    // COMMIT of a failed transaction rolls back and reports no error.
    if (absl::string_view(PQcmdStatus(result.get())) == "ROLLBACK" && sql != "ROLLBACK") {
      return absl::InternalError("PostgreSQL: the transaction was rolled back");
    }
    SqlRows rows;
    for (int row = 0; row < PQntuples(result.get()); ++row) {
      std::vector<SqlValue> columns;
      for (int column = 0; column < PQnfields(result.get()); ++column) {
        columns.push_back(ToValue(result.get(), row, column));
      }
      rows.emplace_back(std::move(columns));
    }
    return rows;
  }

  absl::Status Commit() override { return Run("COMMIT", {}).status(); }

  void Rollback() override {
    if (!connection_ || PQtransactionStatus(connection_.get()) == PQTRANS_IDLE) return;
    if (!Run("ROLLBACK", {}).ok()) connection_.reset();
  }

  // Connects if the connection is gone. UNAVAILABLE.
  absl::Status Connect() {
    if (connection_ && PQstatus(connection_.get()) == CONNECTION_OK) return absl::OkStatus();
    connection_.reset();
    const auto now = steady_clock::now();
    if (now < next_attempt_) return absl::UnavailableError("PostgreSQL: the connection is lost");
    absl::Status opened = Open();
    if (opened.ok()) {
      backoff_ = {};
    } else {
      connection_.reset();
      backoff_ =
          std::clamp<std::chrono::milliseconds>(2 * backoff_, kFirstBackoff, kLongestBackoff);
      next_attempt_ = steady_clock::now() + backoff_;
    }
    return opened;
  }

  void Disconnect() { connection_.reset(); }
  PGconn* get() const { return connection_.get(); }

 private:
  absl::Status Open() {
    // Settings of the connection text come later and override these.
    const char* const keywords[] = {"connect_timeout",
                                    "keepalives_idle",
                                    "keepalives_count",
                                    "keepalives_interval",
                                    "tcp_user_timeout",
                                    "fallback_application_name",
                                    "dbname",
                                    "client_encoding",
                                    nullptr};
    const char* const values[] = {
        "5", "10", "3", "5", "30000", "sightline", connection_text_.c_str(), "UTF8", nullptr};
    connection_.reset(PQconnectdbParams(keywords, values, 1));
    if (!connection_ || PQstatus(connection_.get()) != CONNECTION_OK) {
      return absl::UnavailableError(CannotConnect(
          connection_text_, connection_ ? PQerrorMessage(connection_.get()) : "no memory"));
    }
    // Remarks of the server, e.g. that a table exists already, are not logged.
    PQsetNoticeProcessor(
        connection_.get(), [](void*, const char*) {}, nullptr);
    const char* encoding = PQparameterStatus(connection_.get(), "server_encoding");
    if (!encoding || absl::string_view(encoding) != "UTF8") {
      return absl::FailedPreconditionError(absl::StrCat("PostgreSQL: the database's encoding is ",
                                                        encoding ? encoding : "unknown",
                                                        ", must be UTF8"));
    }
    const ResultHandle set(PQexec(connection_.get(), kSessionSettings));
    if (PQresultStatus(set.get()) != PGRES_TUPLES_OK) {
      return PostgresError(connection_.get(), set.get());
    }
    return absl::OkStatus();
  }

  absl::Status TryBegin(SqlAccess access) {
    was_connected_ = connection_ != nullptr;
    SIGHTLINE_RETURN_IF_ERROR(Connect());
    absl::Status begun =
        Run(access == SqlAccess::kWrite ? "BEGIN ISOLATION LEVEL READ COMMITTED"
                                        : "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY",
            {})
            .status();
    // The lock is a separate statement, so that later statements see all commits from before it.
    if (begun.ok() && access == SqlAccess::kWrite) {
      begun = Run("SELECT pg_advisory_xact_lock($1) IS NULL", {kWriteLock}).status();
    }
    if (begun.ok()) return begun;
    if (!connection_) return begun;
    was_connected_ = false;  // the connection lives; another attempt would fail alike
    Rollback();
    return begun;
  }

  const std::string connection_text_;
  ConnectionHandle connection_;
  bool was_connected_ = false;  // before the last attempt to begin
  std::chrono::milliseconds backoff_{0};
  steady_clock::time_point next_attempt_{};
};

class PostgresDatabase : public SqlDatabase {
 public:
  explicit PostgresDatabase(std::string connection_text)
      : connection_text_(std::move(connection_text)), session_(connection_text_) {}

  absl::Status Open() {
    std::lock_guard lock(mutex_);
    SIGHTLINE_RETURN_IF_ERROR(CheckSession());
    name_ = absl::StrCat("PostgreSQL database ", PQdb(session_.get()));
    SIGHTLINE_RETURN_IF_ERROR(session_.Begin(SqlAccess::kWrite));
    // Not "IF NOT EXISTS", which needs the right to make schemas even if this one exists.
    auto made = session_.Run("SELECT 1 FROM pg_namespace WHERE nspname = 'sightline'", {});
    if (made.ok() && made->empty()) made = session_.Run("CREATE SCHEMA sightline", {});
    absl::Status status = made.ok() ? session_.Commit() : made.status();
    if (!status.ok()) session_.Rollback();
    return status;
  }

  absl::StatusOr<std::unique_ptr<SqlConnection>> Connect() override {
    auto connection = std::make_unique<PostgresConnection>(connection_text_);
    SIGHTLINE_RETURN_IF_ERROR(connection->Connect());
    return connection;
  }
  bool IsShared() const override { return true; }
  // A restored dump has other object numbers of tables, another cluster has another system
  // identifier, and a point-in-time recovery or a promoted standby has another timeline.
  absl::StatusOr<std::string> Instance(SqlConnection* connection) override {
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto rows,
        connection->Run(
            "SELECT 'cluster ' || system_identifier::text || ', timeline ' || timeline_id::text ||"
            " ', table ' || 'sightline.event'::regclass::oid::text"
            " FROM pg_control_system(), pg_control_checkpoint()",
            {}));
    if (rows.empty()) return absl::InternalError(absl::StrCat(name_, ": has no identity"));
    return rows.front().Text(0);
  }
  std::string Name() const override { return name_; }

  absl::StatusOr<int64_t> Owner() override {
    std::lock_guard lock(mutex_);
    SIGHTLINE_RETURN_IF_ERROR(CheckSession());
    return owner_;
  }

  absl::StatusOr<bool> IsOwnerGone(SqlConnection* connection, int64_t owner) override {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto rows,
                               connection->Run("SELECT pg_try_advisory_xact_lock($1)", {owner}));
    return !rows.empty() && rows.front().Int(0) != 0;
  }

  bool Holds(const std::string& role) override {
    std::lock_guard lock(mutex_);
    if (!CheckSession().ok()) return false;
    // A session may take the same lock several times, so it must not be asked again.
    if (roles_.count(role) > 0) return true;
    if (!TryLock(RoleNumber(role))) return false;
    roles_.insert(role);
    return true;
  }

 private:
  // Positive; equals the number of an owner only with a probability of 2^-62.
  static int64_t RoleNumber(const std::string& role) {
    Sha256 digest;
    digest.Update(role);
    return static_cast<int64_t>(FromWire<uint64_t>(digest.Finish().data()) >> 1);
  }

  bool TryLock(int64_t number) {
    const auto rows = session_.Run("SELECT pg_try_advisory_lock($1)", {number});
    return rows.ok() && !rows->empty() && rows->front().Int(0) != 0;
  }

  // Makes sure that the session lives and has an owner number. The caller holds the mutex.
  absl::Status CheckSession() {
    if (session_.get() && owner_ != 0 && session_.Run("SELECT 1", {}).ok()) {
      return absl::OkStatus();
    }
    session_.Disconnect();
    roles_.clear();
    owner_ = 0;
    SIGHTLINE_RETURN_IF_ERROR(session_.Connect());
    const auto number = static_cast<int64_t>(RandomBits() >> 1);
    if (!TryLock(number)) return absl::UnavailableError("PostgreSQL: the connection is lost");
    owner_ = number;
    return absl::OkStatus();
  }

  const std::string connection_text_;
  std::string name_;
  std::mutex mutex_;
  // Session whose locks show other processes that this object lives.
  PostgresConnection session_;  // by mutex_, as all below
  int64_t owner_ = 0;
  std::set<std::string> roles_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenPostgresDatabase(const std::string& connection) {
  auto database = std::make_unique<PostgresDatabase>(connection);
  SIGHTLINE_RETURN_IF_ERROR(database->Open());
  return database;
}

}  // namespace sightline
