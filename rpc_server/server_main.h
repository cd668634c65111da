// SPDX-License-Identifier: Apache-2.0
// Command line, signals and life of a server process.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "rpc_server/rpc_server.h"

namespace sightline {

struct ServerProgram {
  std::string name;
  std::string description;
  std::string version;  // text of --version; empty: there is no such option
  // Adds the options that only this server has.
  std::function<void(CLI::App& app)> add_options;
  // Called once the options are read.
  std::function<absl::StatusOr<std::unique_ptr<RunningServer>>()> start;
  // Time that the end may take beyond --drain-seconds; afterwards the process exits at once.
  absl::Duration stop_within = absl::Seconds(3);
};

// An option for a number of bytes, e.g. 512MB.
void AddBytesOption(CLI::App& app, const char* name, int64_t* value, const char* help);

// Runs `NAME --listen unix:PATH | HOST:PORT [options]`. Prints one line "listening on ADDRESS" to
// stdout when it serves; logs to stderr. SIGTERM and SIGINT drain the server. A second signal, or
// work that does not stop in time, ends the process at once. Fills `options`. Returns the exit
// code: 0 ended as asked, 1 the server could not start, 2 wrong arguments.
int ServerMain(int argc, char** argv, const ServerProgram& program, RpcServerOptions* options);

}  // namespace sightline
