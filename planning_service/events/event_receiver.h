// SPDX-License-Identifier: Apache-2.0
// An outside receiver of job events.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "planning_service/job_store/planning_job_store.h"

namespace sightline {

// All but Interrupt is called by one thread at a time.
class EventReceiver {
 public:
  virtual ~EventReceiver() = default;

  // Name under which the store keeps the receiver's position in the events: the same after every
  // start, another for every receiver. Holds no secrets.
  virtual std::string name() = 0;
  // OK: the receiver has the event and answers for it. FAILED_PRECONDITION: it wants no events any
  // more. All else is tried again, so that it may get an event twice. Takes no longer than half a
  // minute.
  virtual absl::Status Deliver(const JobEvent& event) = 0;
  // Called every few seconds while there is nothing to deliver: restores a connection that broke.
  // Errors as of Deliver.
  virtual absl::Status KeepReady() { return absl::OkStatus(); }
  // From any thread: Deliver and KeepReady return within 50 ms, now and from now on, with any error
  // if they were not done.
  virtual void Interrupt() = 0;
};

}  // namespace sightline
