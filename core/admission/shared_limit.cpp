// SPDX-License-Identifier: Apache-2.0
#include "core/admission/shared_limit.h"

#include <cassert>

namespace sightline {
namespace {

bool Exceeds(int64_t held, int64_t amount, int64_t limit) {
  return held > 0 && amount > limit - held;
}

}  // namespace

SharedLimit::SharedLimit(int64_t max_total, int64_t max_of_owner)
    : accounts_(std::make_shared<Accounts>(max_total, max_of_owner)) {
  assert(max_total >= 0 && max_of_owner >= 0);
}

int64_t SharedLimit::held() const {
  const std::lock_guard lock(accounts_->mutex);
  return accounts_->total;
}

SharedLimit::Share::Share(Share&& other) noexcept
    : accounts_(std::move(other.accounts_)),
      owner_(std::move(other.owner_)),
      held_(std::exchange(other.held_, 0)) {}

SharedLimit::Share& SharedLimit::Share::operator=(Share&& other) noexcept {
  if (this != &other) {
    GiveBack();
    accounts_ = std::move(other.accounts_);
    owner_ = std::move(other.owner_);
    held_ = std::exchange(other.held_, 0);
  }
  return *this;
}

std::optional<Shortage> SharedLimit::Share::Grow(int64_t amount) {
  assert(amount >= 0);
  if (accounts_ == nullptr) return Shortage{};
  if (amount == 0) return std::nullopt;
  const std::lock_guard lock(accounts_->mutex);
  // If all owners together exceed the limit, this owner is not to blame.
  if (Exceeds(accounts_->total, amount, accounts_->max_total)) {
    return Shortage{false, accounts_->total, accounts_->max_total};
  }
  int64_t& of_owner = accounts_->of_owner[owner_];
  if (Exceeds(of_owner, amount, accounts_->max_of_owner)) {
    return Shortage{true, of_owner, accounts_->max_of_owner};
  }
  of_owner += amount;
  accounts_->total += amount;
  held_ += amount;
  return std::nullopt;
}

void SharedLimit::Share::GiveBack() {
  if (held_ == 0) return;
  const std::lock_guard lock(accounts_->mutex);
  accounts_->total -= held_;
  const auto of_owner = accounts_->of_owner.find(owner_);
  of_owner->second -= held_;
  if (of_owner->second == 0) accounts_->of_owner.erase(of_owner);
  held_ = 0;
}

}  // namespace sightline
