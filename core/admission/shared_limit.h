// SPDX-License-Identifier: Apache-2.0
// Limits on a resource (jobs, bytes, connections), for all owners together and for each owner, so
// that no owner takes everything.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace sightline {

// The limit that a request exceeds.
struct Shortage {
  bool of_owner = false;  // the limit of the owner; else of all owners together
  int64_t held = 0;       // amount that counts towards this limit now
  int64_t limit = 0;
};

// Counts held amounts in units of the caller: jobs, bytes, connections. Thread-safe.
class SharedLimit {
  struct Accounts;

 public:
  // Both limits are at least 0.
  SharedLimit(int64_t max_total, int64_t max_of_owner);

  // An amount that an owner holds. Its destructor gives it back, even after the end of the limit.
  class Share {
   public:
    Share() = default;  // without owner: holds nothing and cannot grow
    Share(Share&& other) noexcept;
    Share& operator=(Share&& other) noexcept;
    ~Share() { GiveBack(); }

    // Adds `amount` >= 0 to the share, or returns the shortage and leaves the share unchanged. An
    // amount that alone exceeds a limit is admitted while nothing counts towards that limit.
    std::optional<Shortage> Grow(int64_t amount);
    void GiveBack();
    int64_t held() const { return held_; }

   private:
    friend class SharedLimit;
    Share(std::shared_ptr<Accounts> accounts, std::string owner)
        : accounts_(std::move(accounts)), owner_(std::move(owner)) {}

    std::shared_ptr<Accounts> accounts_;
    std::string owner_;
    int64_t held_ = 0;
  };

  // An empty share of `owner`.
  Share Of(std::string owner) const { return {accounts_, std::move(owner)}; }
  // Held by all shares together.
  int64_t held() const;

 private:
  struct Accounts {
    Accounts(int64_t total_limit, int64_t owner_limit)
        : max_total(total_limit), max_of_owner(owner_limit) {}
    const int64_t max_total;
    const int64_t max_of_owner;
    std::mutex mutex;
    int64_t total = 0;
    std::map<std::string, int64_t> of_owner;  // amounts that are not 0
  };
  const std::shared_ptr<Accounts> accounts_;
};

}  // namespace sightline
