// SPDX-License-Identifier: Apache-2.0
#include "planning_service/events/resolve_host.h"

#include <netdb.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>

#include "absl/strings/str_cat.h"
#include "planning_service/events/interrupt_interval.h"

namespace sightline {
namespace {

// Shared by the caller and the thread that looks up: a running lookup cannot be cancelled.
struct Lookup {
  std::mutex mutex;
  std::condition_variable changed;
  std::optional<int> error;  // of getaddrinfo; unset: it runs
};

}  // namespace

absl::Status CheckHostResolves(const std::string& host, absl::Duration timeout,
                               const std::atomic<bool>& interrupted) {
  const auto lookup = std::make_shared<Lookup>();
  try {
    std::thread([lookup, host] {
      addrinfo hints{};
      hints.ai_socktype = SOCK_STREAM;
      addrinfo* found = nullptr;
      const int error = getaddrinfo(host.c_str(), nullptr, &hints, &found);
      if (error == 0) freeaddrinfo(found);
      std::lock_guard lock(lookup->mutex);
      lookup->error = error;
      lookup->changed.notify_all();
    }).detach();
  } catch (const std::system_error&) {
    return absl::UnavailableError(absl::StrCat("cannot look up ", host, ": no thread for it"));
  }
  const auto end = std::chrono::steady_clock::now() + absl::ToChronoNanoseconds(timeout);
  std::unique_lock lock(lookup->mutex);
  while (!lookup->changed.wait_for(lock, kInterruptInterval,
                                   [&] { return lookup->error.has_value(); })) {
    if (interrupted) return absl::CancelledError("interrupted");
    if (std::chrono::steady_clock::now() >= end) {
      return absl::UnavailableError(absl::StrCat("looking up ", host, " takes too long"));
    }
  }
  if (*lookup->error == 0) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("host ", host, " is not known: ", gai_strerror(*lookup->error)));
}

}  // namespace sightline
