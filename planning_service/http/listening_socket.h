// SPDX-License-Identifier: Apache-2.0
// A TCP socket that accepts connections.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sightline {

// Closes its descriptor.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int descriptor) : descriptor_(descriptor) {}
  ~FileDescriptor();
  FileDescriptor(FileDescriptor&& other) noexcept;
  FileDescriptor& operator=(FileDescriptor&& other) noexcept;

  int get() const { return descriptor_; }

 private:
  int descriptor_ = -1;
};

struct ListeningSocket {
  FileDescriptor descriptor;  // non-blocking, close-on-exec
  std::string host;           // as asked for, without brackets
  std::string address;        // HOST:PORT with the actual port
  bool is_loopback = false;   // true: only this machine reaches it
};

// `listen`: HOST:PORT or [IPv6]:PORT, port 0: any free one. INVALID_ARGUMENT names `option`;
// UNAVAILABLE: the address is taken or not this machine's.
absl::StatusOr<ListeningSocket> ListenTcp(const std::string& option, const std::string& listen);

}  // namespace sightline
