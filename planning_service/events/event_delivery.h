// SPDX-License-Identifier: Apache-2.0
// Brings every job event to every receiver: in order, at least once, through restarts.
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
  // After the n-th failure in a row: between half and all of 2^n times the first, but no more than
  // the longest.
  absl::Duration first_retry_delay = absl::Seconds(1);
  absl::Duration longest_retry_delay = absl::Minutes(5);
  // Seed of the random part of the times between attempts.
  uint64_t seed = 1;
};

struct ReceiverState {
  std::string name;
  int64_t delivered_events = 0;  // since the start
  bool is_failing = false;
  bool has_ended = false;  // it wants no events any more
};

// A thread per receiver, so that none waits for another. Delivers only while this process holds the
// receiver (PlanningJobStore::HoldsReceiver). Thread-safe.
class EventDelivery {
 public:
  // Names of receivers must differ. `store` must outlive it.
  EventDelivery(PlanningJobStore* store, std::vector<std::unique_ptr<EventReceiver>> receivers,
                EventDeliveryOptions options = {});
  // Stops, then lets the receivers say goodbye.
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
  mutable std::mutex mutex_;  // guards states of lanes
  std::condition_variable stop_;
  std::vector<std::unique_ptr<Lane>> lanes_;
};

}  // namespace sightline
