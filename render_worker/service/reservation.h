// SPDX-License-Identifier: Apache-2.0
// Share of a limit.
#pragma once

#include <atomic>
#include <cstdint>

namespace sightline {

// Adds to a counter for as long as it lives.
class Reservation {
 public:
  Reservation(std::atomic<int64_t>* counter, int64_t amount)
      : counter_(counter), amount_(amount), total_(counter->fetch_add(amount) + amount) {}
  ~Reservation() { *counter_ -= amount_; }
  Reservation(const Reservation&) = delete;
  Reservation& operator=(const Reservation&) = delete;
  // The counter with this reservation.
  int64_t total() const { return total_; }

 private:
  std::atomic<int64_t>* const counter_;
  const int64_t amount_;
  const int64_t total_;
};

}  // namespace sightline
