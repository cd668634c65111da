// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/upload.h"

namespace sightline {

UploadMemory::Share::~Share() {
  if (memory_ == nullptr || bytes_ == 0) return;
  const std::lock_guard lock(memory_->mutex_);
  memory_->bytes_ -= bytes_;
  const auto of_peer = memory_->bytes_of_peer_.find(peer_);
  of_peer->second -= bytes_;
  if (of_peer->second == 0) memory_->bytes_of_peer_.erase(of_peer);
}

absl::Status UploadMemory::Share::Grow(int64_t bytes) {
  const std::lock_guard lock(memory_->mutex_);
  const auto of_peer = memory_->bytes_of_peer_.find(peer_);
  const int64_t held = of_peer == memory_->bytes_of_peer_.end() ? 0 : of_peer->second;
  const bool peer_has_too_much = held + bytes > memory_->max_bytes_per_peer_;
  if (peer_has_too_much || memory_->bytes_ + bytes > memory_->max_bytes_) {
    return WithRetryDelay(
        WithErrorInfo(
            absl::UnavailableError(absl::StrCat(
                "overloaded: ", peer_has_too_much ? peer_ + " is" : "clients are", " uploading ",
                peer_has_too_much ? held : memory_->bytes_, " bytes already")),
            "OVERLOADED"),
        absl::Seconds(1));
  }
  memory_->bytes_ += bytes;
  memory_->bytes_of_peer_[peer_] += bytes;
  bytes_ += bytes;
  return absl::OkStatus();
}

int64_t UploadMemory::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

}  // namespace sightline
