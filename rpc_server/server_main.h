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
  // Adds the options this server has beside those of every server.
  std::function<void(CLI::App& app)> add_options;
  // Called once the options are read.
  std::function<absl::StatusOr<std::unique_ptr<RunningServer>>()> start;
  // How long the end may take beyond what running calls are given; then the process just ends.
  absl::Duration stop_within = absl::Seconds(3);
};

// An option for a number of bytes, e.g. 512MB.
void AddBytesOption(CLI::App& app, const char* name, int64_t* value, const char* help);

// `NAME --listen unix:PATH | HOST:PORT [options]`. Prints one line "listening on ADDRESS" to stdout
// when it serves; logs to stderr. SIGTERM and SIGINT drain; a second one, or
// work that does not stop, ends the process without waiting any longer. Fills `options`. Returns
// the exit code: 0 ended as asked, 1 failed while running, 2 wrong arguments.
int ServerMain(int argc, char** argv, const ServerProgram& program, RpcServerOptions* options);

}  // namespace sightline
