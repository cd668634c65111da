// SPDX-License-Identifier: Apache-2.0
// A server of one's own (coverage server, render worker): started, watched and ended by this
// process.
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
  // Further arguments, e.g. {"--threads", "1"}. "{folder}" stands for a folder for its files:
  // the private one if that is in the temporary folder (TMPDIR), else the temporary folder itself.
  std::vector<std::string> arguments;
  // Limit of the time that it takes by itself until it listens (core/process/process_clock.h): CPU
  // time and sleep. The time during which a busy machine holds it up does not count.
  absl::Duration start_limit = absl::Minutes(5);
  // After this wall time one line on stderr names the awaited server and the place of its messages.
  absl::Duration start_notice = absl::Seconds(20);
  // Unless null: a start ends once this is true, and a restart once it becomes true (a command that
  // was interrupted before still needs the server for its output).
  const std::atomic<bool>* interrupted = nullptr;
  // How long it may take to end before it is killed.
  absl::Duration stop_timeout = absl::Seconds(3);
};

// The server listens on a unix socket in a folder that only this user can enter. It runs in its own
// process group (Ctrl-C reaches only us) and ends when this process ends, however that happens; the
// next server that starts then removes the folder.
// Thread-safe.
class EmbeddedServer {
 public:
  // Waits until the server listens, as long as its process lives and has not failed. NOT_FOUND: no
  // such binary. UNAVAILABLE: it ended, or closed its stdout, before it listened.
  // DEADLINE_EXCEEDED: it used `start_limit`, by work or by sleep, and does not listen. These
  // messages end with its stderr. CANCELLED: interrupted. A server that is killed by
  // others before it listens is restarted, as at any later time.
  static absl::StatusOr<std::unique_ptr<EmbeddedServer>> Start(EmbeddedServerOptions options);
  // Ends the server and removes the folder.
  virtual ~EmbeddedServer() = default;

  // "unix:PATH"; stays the same over restarts.
  virtual const std::string& address() const = 0;
  virtual int pid() const = 0;
  // Folder for the server's files; goes when the server ends.
  virtual const std::string& folder() const = 0;
  // OK while it runs; UNAVAILABLE says how it ended, with its last output.
  virtual absl::Status CheckAlive() = 0;
  // Starts it anew if it has ended, and says so on stderr; the new one has none of the old one's
  // parts and scenes. Once in its life: a server that ends again has a fault that its user must
  // know of. UNAVAILABLE: it was restarted before; says how it ended.
  virtual absl::Status Restart() = 0;
};

}  // namespace sightline
