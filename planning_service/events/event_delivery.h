// SPDX-License-Identifier: Apache-2.0
// Delivers every job event to every receiver, in order and at least once, also across restarts.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "planning_service/events/event_receiver.h"
#include "planning_service/job_store/planning_job_store.h"

namespace sightline {

struct EventDeliveryOptions {
  // Delay after the n-th failure in a row: a random fraction in [1/2, 1] of
  // min(2^n first_retry_delay, longest_retry_delay).
  absl::Duration first_retry_delay = absl::Seconds(1);
  absl::Duration longest_retry_delay = absl::Minutes(5);
  // Seed of the random fractions of the delays.
  uint64_t seed = 1;
};

struct ReceiverState {
  std::string name;
  int64_t delivered_events = 0;  // since the start
  bool is_failing = false;
  bool has_ended = false;  // the receiver wants no more events
};

// Has one thread per receiver, so that no receiver waits for another. Delivers only while this
// process holds the receiver (PlanningJobStore::HoldsReceiver). Thread-safe.
class EventDelivery {
 public:
  // Names of receivers must differ. `store` must outlive it.
  EventDelivery(PlanningJobStore* store, std::vector<std::unique_ptr<EventReceiver>> receivers,
                EventDeliveryOptions options = {});
  // Stops, then destroys the receivers, which may send a last message.
  ~EventDelivery();

  // Returns within 100 ms. Undelivered events are delivered after the next start.
  void Stop();
  std::vector<ReceiverState> receivers() const;

 private:
  struct Lane;

  void Run(Lane* lane);
  absl::Status Step(Lane* lane);
  void NoteFailure(Lane* lane, const absl::Status& status);
  void NoteSuccess(Lane* lane);
  // Returns early when stopped.
  void Wait(absl::Duration duration);

  PlanningJobStore* const store_;
  const EventDeliveryOptions options_;
  std::atomic<bool> stopped_ = false;
  mutable std::mutex mutex_;  // guards the states of the lanes
  std::condition_variable stop_;
  std::vector<std::unique_ptr<Lane>> lanes_;
};

}  // namespace sightline
