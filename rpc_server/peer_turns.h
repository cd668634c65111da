// SPDX-License-Identifier: Apache-2.0
// Work that takes much memory, a few at a time and one of each peer.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {

// Turns that calls wait for. A peer has at most one, so that one which sends expensive work without
// end leaves the other turns to others. Thread-safe; must outlive its turns.
class PeerTurns {
 public:
  // `turns`: at least 1.
  explicit PeerTurns(size_t turns) : turns_(turns) {}

  // Given back when it goes.
  class Turn {
   public:
    Turn(PeerTurns* turns, std::string peer) : turns_(turns), peer_(std::move(peer)) {}
    Turn(Turn&& other) noexcept
        : turns_(std::exchange(other.turns_, nullptr)), peer_(std::move(other.peer_)) {}
    Turn& operator=(Turn&&) = delete;
    ~Turn();

   private:
    PeerTurns* turns_;
    std::string peer_;
  };

  // Waits until a turn is free and `peer` has none. `check_stop` is asked some ten times a second;
  // its error ends the wait and is returned.
  absl::StatusOr<Turn> Wait(const std::string& peer,
                            const std::function<absl::Status()>& check_stop);

 private:
  const size_t turns_;
  std::mutex mutex_;
  std::condition_variable given_back_;
  std::set<std::string> peers_;  // that have a turn
};

}  // namespace sightline
