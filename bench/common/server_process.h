// SPDX-License-Identifier: Apache-2.0
// A real coverage_server process to measure.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>

namespace sightline::bench {

// Runs coverage_server from the folder of this executable. Its stderr goes to ours.
class ServerProcess {
 public:
  // `listen`: "unix:PATH" or "127.0.0.1:0". Ends this process if the server does not start.
  explicit ServerProcess(const std::string& listen);
  // SIGTERM, then waits.
  ~ServerProcess();
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  const std::string& address() const { return address_; }
  pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
  std::string address_;
};

}  // namespace sightline::bench
