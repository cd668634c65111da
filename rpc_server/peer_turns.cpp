// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/peer_turns.h"

#include <chrono>

#include "core/status/status_macros.h"

namespace sightline {

PeerTurns::Turn::~Turn() {
  if (turns_ == nullptr) return;
  {
    const std::lock_guard lock(turns_->mutex_);
    turns_->peers_.erase(peer_);
  }
  turns_->given_back_.notify_all();
}

absl::StatusOr<PeerTurns::Turn> PeerTurns::Wait(const std::string& peer,
                                                const std::function<absl::Status()>& check_stop) {
  std::unique_lock lock(mutex_);
  while (peers_.size() >= turns_ || peers_.contains(peer)) {
    SIGHTLINE_RETURN_IF_ERROR(check_stop());
    given_back_.wait_for(lock, std::chrono::milliseconds(100));
  }
  peers_.insert(peer);
  return Turn(this, peer);
}

}  // namespace sightline
