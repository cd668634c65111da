// SPDX-License-Identifier: Apache-2.0
// An embedded server (coverage server, render worker): this process starts, watches and ends
// it.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sightline {

struct EmbeddedServerOptions {
  // Name of the program, and its name in messages.
  std::string program = "coverage_server";
  std::string description = "coverage server";
  // Path of the program. Empty: FindProgram(program) of core/process/program_path.h.
  std::string binary;
  // Further arguments, e.g. {"--threads", "1"}. "{folder}" is replaced by a folder for the server's
  // files: the private one if it is in the temporary folder (TMPDIR), else the temporary folder.
  std::vector<std::string> arguments;
  // Limit of the time that the server itself spends until it listens
  // (core/process/process_clock.h): CPU time and sleep. Time during which a busy machine delays it
  // does not count.
  absl::Duration start_limit = absl::Minutes(5);
  // After this wall time, one line on stderr names the awaited server and its message file.
  absl::Duration start_notice = absl::Seconds(20);
  // Unless null: a true value ends a start, and a change to true ends a restart (a command that was
  // interrupted earlier still needs the server for its output).
  const std::atomic<bool>* interrupted = nullptr;
  // How long it may take to end before it is killed.
  absl::Duration stop_timeout = absl::Seconds(3);
};

// The server listens on a unix socket in a folder that only this user can enter. It
// runs in its own process group (Ctrl-C reaches only the client) and ends when this
// process ends for any reason; the next server that starts then removes the folder.
// Thread-safe.
class EmbeddedServer {
 public:
  // Waits until the server listens. NOT_FOUND: no such binary. UNAVAILABLE: it ended, or
  // closed its stdout, before it listened. DEADLINE_EXCEEDED: it used `start_limit` of work
  // and sleep without listening. These messages end with its stderr. CANCELLED:
  // interrupted. A server that others kill before it listens is restarted, as at any later
  // time.
  static absl::StatusOr<std::unique_ptr<EmbeddedServer>> Start(EmbeddedServerOptions options);
  // Ends the server and removes the folder.
  virtual ~EmbeddedServer() = default;

  // "unix:PATH"; stays the same over restarts.
  virtual const std::string& address() const = 0;
  virtual int pid() const = 0;
  // Folder for the server's files; goes when the server ends.
  virtual const std::string& folder() const = 0;
  // OK while it runs; UNAVAILABLE states how it ended, with its last output.
  virtual absl::Status CheckAlive() = 0;
  // Restarts the server if it has ended, with a message on stderr; the new process has no parts and
  // scenes. This is done only once: a server that ends again has a fault that the user must know
  // about. UNAVAILABLE after an earlier restart; the message states how the server ended.
  virtual absl::Status Restart() = 0;
};

}  // namespace sightline
