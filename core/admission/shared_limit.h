// SPDX-License-Identifier: Apache-2.0
// How much of something all may hold together, and one owner of it: so that one leaves something
// to the others.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace sightline {

// Why there is not as much as was asked for.
struct Shortage {
  bool of_owner = false;  // its own limit, or else that of all together
  int64_t held = 0;       // of that limit, now
  int64_t limit = 0;
};

// Counts held amounts in units of the caller: jobs, bytes, connections. Thread-safe.
class SharedLimit {
  struct Accounts;

 public:
  // Both at least 0.
  SharedLimit(int64_t max_total, int64_t max_of_owner);

  // The amount that an owner holds; given back when it goes, also after the limit itself has gone.
  class Share {
   public:
    Share() = default;  // of nobody: holds nothing, and cannot grow
    Share(Share&& other) noexcept;
    Share& operator=(Share&& other) noexcept;
    ~Share() { GiveBack(); }

    // Adds `amount`, at least 0, to it, or says why not and leaves it as it is. An amount that
    // alone exceeds a limit is admitted while nothing else is held; it could never be otherwise.
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
    std::map<std::string, int64_t> of_owner;  // those that are not 0
  };
  const std::shared_ptr<Accounts> accounts_;
};

}  // namespace sightline
