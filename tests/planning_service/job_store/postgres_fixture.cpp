// SPDX-License-Identifier: Apache-2.0
#include "tests/planning_service/job_store/postgres_fixture.h"

#include <fcntl.h>
#include <glob.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <libpq-fe.h>
#include <pwd.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <system_error>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace sightline {
namespace {

[[noreturn]] void Abort(const std::string& message) {
  std::fprintf(stderr, "PostgreSQL of the tests: %s\n", message.c_str());
  std::abort();
}

std::string FindBinaries() {
  glob_t found{};
  std::string folder;
  if (glob("/usr/lib/postgresql/*/bin/postgres", 0, nullptr, &found) == 0) {
    folder = std::filesystem::path(found.gl_pathv[found.gl_pathc - 1]).parent_path().string();
  }
  globfree(&found);
  if (folder.empty()) Abort("not installed (Debian package postgresql)");
  return folder;
}

// PostgreSQL refuses to run as root.
const passwd* ServerUser() {
  if (geteuid() != 0) return nullptr;
  const passwd* user = getpwnam("postgres");
  if (user == nullptr) Abort("there is no user postgres");
  return user;
}

pid_t Spawn(const std::vector<std::string>& command, const std::string& log) {
  std::vector<char*> arguments;
  for (const std::string& argument : command) {
    arguments.push_back(const_cast<char*>(argument.c_str()));
  }
  arguments.push_back(nullptr);
  const passwd* user = ServerUser();
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid != 0) return pid;
  if (user != nullptr &&
      (setgroups(0, nullptr) != 0 || setgid(user->pw_gid) != 0 || setuid(user->pw_uid) != 0)) {
    _exit(126);
  }
  // After the change of user, which would undo it. SIGQUIT ends PostgreSQL at once.
  prctl(PR_SET_PDEATHSIG, SIGQUIT);
  if (getppid() != parent) _exit(126);
  const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  dup2(output, STDOUT_FILENO);
  dup2(output, STDERR_FILENO);
  if (chdir("/") != 0) _exit(126);
  execv(arguments[0], arguments.data());
  _exit(127);
}

}  // namespace

PostgresServer& PostgresServer::Get() {
  static PostgresServer server;
  return server;
}

PostgresServer::PostgresServer() : binaries_(FindBinaries()) {
  std::string folder = "/tmp/sightline_postgres_XXXXXX";
  if (mkdtemp(folder.data()) == nullptr) Abort("no temporary folder");
  folder_ = folder;
  Own(folder_);
  const pid_t pid = Spawn({binaries_ + "/initdb", "-D", folder_ + "/data", "-U", "postgres", "-A",
                           "trust", "-E", "UTF8", "--locale=C", "--no-sync"},
                          folder_ + "/initdb.log");
  int status = 0;
  if (waitpid(pid, &status, 0) != pid || status != 0) Abort("initdb failed, see " + folder_);
  Start();
}

PostgresServer::~PostgresServer() {
  Stop();
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

void PostgresServer::Own(const std::string& folder) const {
  const passwd* user = ServerUser();
  if (user != nullptr && chown(folder.c_str(), user->pw_uid, user->pw_gid) != 0) {
    Abort("cannot give away " + folder);
  }
  // Clients of other users reach the socket in it.
  chmod(folder.c_str(), 0755);
}

void PostgresServer::Start() {
  // Nothing here has to outlive a power cut.
  pid_ = Spawn({binaries_ + "/postgres", "-D", folder_ + "/data", "-k", folder_, "-c",
                "listen_addresses=", "-c", "fsync=off", "-c", "max_connections=60"},
               folder_ + "/postgres.log");
  while (PQping(Connection("postgres").c_str()) != PQPING_OK) {
    if (waitpid(pid_, nullptr, WNOHANG) != 0) Abort("does not start, see " + folder_);
    absl::SleepFor(absl::Milliseconds(20));
  }
}

void PostgresServer::Stop() {
  if (pid_ < 0) return;
  kill(pid_, SIGQUIT);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

std::string PostgresServer::Connection(const std::string& database) const {
  return absl::StrCat("host=", folder_, " user=postgres dbname=", database);
}

std::string PostgresServer::NewDatabase(const std::string& options) {
  const std::string name = absl::StrCat("test_", ++databases_);
  Run(absl::StrCat("CREATE DATABASE ", name, " ", options));
  return Connection(name);
}

std::string PostgresServer::Run(const std::string& sql, const std::string& database) {
  const std::unique_ptr<PGconn, void (*)(PGconn*)> connection(
      PQconnectdb(Connection(database).c_str()), PQfinish);
  const std::unique_ptr<PGresult, void (*)(PGresult*)> result(PQexec(connection.get(), sql.c_str()),
                                                              PQclear);
  const ExecStatusType status = PQresultStatus(result.get());
  EXPECT_TRUE(status == PGRES_TUPLES_OK || status == PGRES_COMMAND_OK)
      << sql << ": " << PQerrorMessage(connection.get());
  return PQntuples(result.get()) > 0 ? PQgetvalue(result.get(), 0, 0) : "";
}

int PostgresServer::CutConnections(const std::string& application_name) {
  int cut = 0;
  EXPECT_TRUE(absl::SimpleAtoi(
      Run(absl::StrCat("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity"
                       " WHERE application_name = '",
                       application_name, "'")),
      &cut));
  return cut;
}

}  // namespace sightline
