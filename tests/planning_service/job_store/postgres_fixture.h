// SPDX-License-Identifier: Apache-2.0
// A real PostgreSQL for tests, in a temporary folder, reachable by a unix socket alone.
#pragma once

#include <sys/types.h>

#include <string>

#include "absl/status/status.h"

namespace sightline {

// Started once per test program by `PostgresServer::Get`; ends with the program, however that ends.
class PostgresServer {
 public:
  // The test program's server. Aborts with a message if there is none to start.
  static PostgresServer& Get();
  ~PostgresServer();
  PostgresServer(const PostgresServer&) = delete;
  PostgresServer& operator=(const PostgresServer&) = delete;

  // libpq text for a new, empty database; `options` of CREATE DATABASE.
  std::string NewDatabase(const std::string& options = "");
  // Runs a statement as the superuser; first column of the first row, or empty. Fails the test on
  // an error.
  std::string Run(const std::string& sql, const std::string& database = "postgres");
  // Cuts the connections that have this application_name; returns how many.
  int CutConnections(const std::string& application_name);

  void Stop();
  void Start();

  // Gives a folder to the user that the server runs as.
  void Own(const std::string& folder) const;

 private:
  PostgresServer();
  std::string Connection(const std::string& database) const;

  std::string folder_;
  std::string binaries_;
  pid_t pid_ = -1;
  int databases_ = 0;
};

}  // namespace sightline
