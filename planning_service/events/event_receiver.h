// SPDX-License-Identifier: Apache-2.0
// An outside receiver of job events.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "planning_service/job_store/planning_job_store.h"

namespace sightline {

// One thread at a time calls the methods; Interrupt may be called at any time.
class EventReceiver {
 public:
  virtual ~EventReceiver() = default;

  // Name under which the store keeps the receiver's position in the events. It is unique, stays the
  // same across restarts and holds no secrets.
  virtual std::string name() = 0;
  // OK: the receiver has accepted the event. FAILED_PRECONDITION: it wants no more events. After
  // any other error the caller tries again, so the receiver may get an event twice. Takes at most
  // half a minute.
  virtual absl::Status Deliver(const JobEvent& event) = 0;
  // Called every few seconds while there is nothing to deliver. Restores a broken connection.
  // Errors as for Deliver.
  virtual absl::Status KeepReady() { return absl::OkStatus(); }
  // May be called from any thread. Running and later calls of Deliver and KeepReady then return
  // within 50 ms, with an error if they could not finish.
  virtual void Interrupt() = 0;
};

}  // namespace sightline
