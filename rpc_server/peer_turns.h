// SPDX-License-Identifier: Apache-2.0
// Limits work that takes much memory: a few calls at a time, one of each peer.
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

// Calls wait for a turn. A peer has at most one turn, so a peer that sends expensive work without
// end leaves the other turns to other peers. Thread-safe; must outlive its turns.
class PeerTurns {
 public:
  // `turns`: at least 1.
  explicit PeerTurns(size_t turns) : turns_(turns) {}

  // Its destructor gives the turn back.
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

  // Waits until a turn is free and `peer` has none. Calls `check_stop` about ten times a second; an
  // error of it ends the wait and is returned.
  absl::StatusOr<Turn> Wait(const std::string& peer,
                            const std::function<absl::Status()>& check_stop);

 private:
  const size_t turns_;
  std::mutex mutex_;
  std::condition_variable given_back_;
  std::set<std::string> peers_;  // peers that have a turn
};

}  // namespace sightline
