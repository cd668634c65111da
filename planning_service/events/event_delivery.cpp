// SPDX-License-Identifier: Apache-2.0
#include "planning_service/events/event_delivery.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "core/random/counter_random.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr int kEventsAtATime = 100;
// A wait of the store cannot be interrupted, so a stop takes effect after at most this time.
constexpr absl::Duration kLongestStoreWait = absl::Milliseconds(50);
// Time after which a process takes over a receiver whose holder is gone.
constexpr absl::Duration kHoldInterval = absl::Milliseconds(500);
constexpr std::chrono::seconds kReadyInterval{5};

}  // namespace

struct EventDelivery::Lane {
  Lane(std::unique_ptr<EventReceiver> r, uint64_t seed, uint64_t index)
      : receiver(std::move(r)), random(DeriveSeed(seed, "event delivery", index), 0) {
    state.name = receiver->name();
  }

  const std::unique_ptr<EventReceiver> receiver;
  ReceiverState state;  // guarded by the delivery's mutex, but for the name
  // The rest belongs to the lane's thread.
  CounterRandom random;
  std::optional<int64_t> cursor;  // unset: to be read from the store
  bool cursor_is_saved = true;
  std::optional<SteadyClock::time_point> ready_since;  // last KeepReady or Deliver that succeeded
  int failures = 0;                                    // in a row
  SteadyClock::time_point failing_since;
  std::thread thread;
};

EventDelivery::EventDelivery(PlanningJobStore* store,
                             std::vector<std::unique_ptr<EventReceiver>> receivers,
                             EventDeliveryOptions options)
    : store_(store), options_(options) {
  for (size_t i = 0; i < receivers.size(); ++i) {
    lanes_.push_back(std::make_unique<Lane>(std::move(receivers[i]), options_.seed, i));
  }
  for (const std::unique_ptr<Lane>& lane : lanes_) {
    lane->thread = std::thread([this, l = lane.get()] { Run(l); });
  }
}

EventDelivery::~EventDelivery() { Stop(); }

void EventDelivery::Stop() {
  {
    std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  stop_.notify_all();
  for (const std::unique_ptr<Lane>& lane : lanes_) lane->receiver->Interrupt();
  for (const std::unique_ptr<Lane>& lane : lanes_) {
    if (lane->thread.joinable()) lane->thread.join();
  }
}

std::vector<ReceiverState> EventDelivery::receivers() const {
  std::lock_guard lock(mutex_);
  std::vector<ReceiverState> states;
  for (const std::unique_ptr<Lane>& lane : lanes_) states.push_back(lane->state);
  return states;
}

void EventDelivery::Run(Lane* lane) {
  while (!stopped_) {
    if (!store_->HoldsReceiver(lane->state.name)) {
      // Another process may move the cursor meanwhile.
      lane->cursor.reset();
      lane->cursor_is_saved = true;
      Wait(kHoldInterval);
      continue;
    }
    const absl::Status status = Step(lane);
    if (stopped_) return;
    if (absl::IsFailedPrecondition(status)) {
      spdlog::warn("event=receiver_ended receiver={:?} message={:?}", lane->state.name,
                   std::string(status.message()));
      std::lock_guard lock(mutex_);
      lane->state.has_ended = true;
      return;
    }
    if (!status.ok()) NoteFailure(lane, status);
  }
}

// Delivers pending events, or waits a moment for one.
absl::Status EventDelivery::Step(Lane* lane) {
  EventReceiver& receiver = *lane->receiver;
  const std::string& name = lane->state.name;
  if (!lane->cursor) {
    const absl::StatusOr<int64_t> cursor = store_->EventCursor(name);
    // FAILED_PRECONDITION of the store must not be taken for that of the receiver.
    if (!cursor.ok()) return absl::UnavailableError(cursor.status().message());
    lane->cursor = *cursor;
  }
  const auto save = [&] {
    if (lane->cursor_is_saved) return absl::OkStatus();
    const absl::Status saved = store_->SetEventCursor(name, *lane->cursor);
    if (!saved.ok()) return absl::UnavailableError(saved.message());
    lane->cursor_is_saved = true;
    return absl::OkStatus();
  };
  SIGHTLINE_RETURN_IF_ERROR(save());
  const absl::StatusOr<std::vector<JobEvent>> events =
      store_->Events(*lane->cursor, std::nullopt, kEventsAtATime);
  if (!events.ok()) return absl::UnavailableError(events.status().message());

  if (events->empty()) {
    if (lane->failures > 0 || !lane->ready_since ||
        SteadyClock::now() - *lane->ready_since > kReadyInterval) {
      SIGHTLINE_RETURN_IF_ERROR(receiver.KeepReady());
      NoteSuccess(lane);
    }
    store_->WaitForEvent(*lane->cursor, kLongestStoreWait);
    return absl::OkStatus();
  }
  for (const JobEvent& event : *events) {
    if (stopped_ || !store_->HoldsReceiver(name)) return absl::OkStatus();
    SIGHTLINE_RETURN_IF_ERROR(receiver.Deliver(event));
    // The cursor is kept here too, so that events are not repeated while the store does not answer.
    lane->cursor = event.sequence;
    lane->cursor_is_saved = false;
    {
      std::lock_guard lock(mutex_);
      ++lane->state.delivered_events;
    }
    NoteSuccess(lane);
    SIGHTLINE_RETURN_IF_ERROR(save());
  }
  return absl::OkStatus();
}

void EventDelivery::NoteFailure(Lane* lane, const absl::Status& status) {
  if (lane->failures == 0) {
    lane->failing_since = SteadyClock::now();
    spdlog::warn("event=receiver_failing receiver={:?} code={} message={:?}", lane->state.name,
                 absl::StatusCodeToString(status.code()), std::string(status.message()));
    std::lock_guard lock(mutex_);
    lane->state.is_failing = true;
  }
  ++lane->failures;
  absl::Duration longest = options_.first_retry_delay;
  for (int i = 0; i < lane->failures && longest < options_.longest_retry_delay; ++i) longest *= 2;
  longest = std::min(longest, options_.longest_retry_delay);
  Wait(longest * (0.5 + 0.5 * lane->random.Uniform()));
}

void EventDelivery::NoteSuccess(Lane* lane) {
  lane->ready_since = SteadyClock::now();
  if (lane->failures == 0) return;
  const std::chrono::duration<double> failing_s = SteadyClock::now() - lane->failing_since;
  spdlog::info("event=receiver_recovered receiver={:?} failing_s={:.1f} failures={}",
               lane->state.name, failing_s.count(), lane->failures);
  lane->failures = 0;
  std::lock_guard lock(mutex_);
  lane->state.is_failing = false;
}

void EventDelivery::Wait(absl::Duration duration) {
  std::unique_lock lock(mutex_);
  stop_.wait_for(lock, absl::ToChronoNanoseconds(duration), [this] { return stopped_.load(); });
}

}  // namespace sightline
