// SPDX-License-Identifier: Apache-2.0
// Delivery by itself: receivers and a store that fail on command.
#include "planning_service/events/event_delivery.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ringbuffer_sink.h>
#include <spdlog/spdlog.h>

#include <map>
#include <mutex>

#include "stored_events.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Holds events and cursors; all else is not asked for.
class FakeEventStore final : public PlanningJobStore {
 public:
  void Add(int count) {
    std::lock_guard lock(mutex_);
    for (int i = 0; i < count; ++i) {
      JobEvent event;
      event.sequence = static_cast<int64_t>(events_.size()) + 1;
      event.type = "progress";
      event.job.job_id = "job";
      events_.push_back(event);
    }
  }
  void SetHeld(bool held) { held_ = held; }
  void SetWritable(bool writable) { writable_ = writable; }
  void SetReadable(bool readable) { readable_ = readable; }
  int64_t Cursor(const std::string& receiver) {
    std::lock_guard lock(mutex_);
    return cursors_[receiver];
  }

  absl::StatusOr<std::vector<JobEvent>> Events(int64_t after, const std::optional<std::string>&,
                                               int limit) override {
    std::lock_guard lock(mutex_);
    // A code that a receiver ends itself with.
    if (!readable_) return absl::FailedPreconditionError("closed");
    std::vector<JobEvent> found;
    for (const JobEvent& event : events_) {
      if (event.sequence > after && static_cast<int>(found.size()) < limit) found.push_back(event);
    }
    return found;
  }
  void WaitForEvent(int64_t, absl::Duration timeout) override {
    absl::SleepFor(std::min(timeout, absl::Milliseconds(1)));
  }
  absl::StatusOr<bool> BeginService() override { return false; }
  absl::StatusOr<int64_t> NewestEvent() override { return Not(); }
  absl::StatusOr<bool> HasEvent(int64_t) override { return Not(); }
  absl::StatusOr<int64_t> EventCursor(const std::string& receiver) override {
    return Cursor(receiver);
  }
  absl::Status SetEventCursor(const std::string& receiver, int64_t sequence) override {
    std::lock_guard lock(mutex_);
    if (!writable_) return absl::UnavailableError("locked");
    cursors_[receiver] = sequence;
    return absl::OkStatus();
  }
  bool HoldsReceiver(const std::string&) override { return held_; }

  absl::StatusOr<PlanningJob> Create(const NewPlanningJob&, const ClientQuota&) override {
    return Not();
  }
  absl::StatusOr<PlanningJob> Get(const std::string&) override { return Not(); }
  absl::StatusOr<std::vector<PlanningJob>> List(const PlanningJobFilter&) override { return Not(); }
  absl::StatusOr<PlanningJob> RequestCancel(const std::string&) override { return Not(); }
  absl::StatusOr<PlanningJob> WaitForChange(const std::string&, int64_t, absl::Duration) override {
    return Not();
  }
  absl::StatusOr<Counts> Count(const std::optional<std::string>&) override { return Not(); }
  absl::StatusOr<std::optional<PlanningJob>> Claim(
      const std::function<ClientQuota(const std::string&)>&) override {
    return Not();
  }
  absl::StatusOr<bool> ReportProgress(const Attempt&, double, const std::string&) override {
    return Not();
  }
  absl::Status Succeed(const Attempt&, const std::vector<JobFile>&) override { return Not(); }
  absl::Status Fail(const Attempt&, const JobFailure&) override { return Not(); }
  absl::Status MarkCancelled(const Attempt&) override { return Not(); }
  absl::Status Requeue(const Attempt&, bool, bool) override { return Not(); }
  absl::StatusOr<int> RequeueOrphans() override { return Not(); }
  absl::StatusOr<Recipe> GetRecipe(const std::string&, const std::string&) override {
    return Not();
  }
  absl::Status PutRecipe(const Recipe&, const ClientQuota&) override { return Not(); }
  absl::Status DeleteRecipe(const std::string&, const std::string&) override { return Not(); }
  absl::StatusOr<int> CountRecipes(const std::string&) override { return Not(); }
  absl::Status AddUpload(const std::string&, const JobFile&, const ClientQuota&) override {
    return Not();
  }
  absl::StatusOr<std::optional<int64_t>> FindFile(const std::string&, const std::string&) override {
    return Not();
  }
  absl::Status AdvanceServiceTime(absl::Duration) override { return Not(); }
  absl::StatusOr<int> RemoveOlderThan(absl::Duration) override { return Not(); }
  absl::StatusOr<std::set<std::string>> NamedDigests() override { return Not(); }

 private:
  static absl::Status Not() { return absl::UnimplementedError("not of this test"); }

  std::mutex mutex_;
  std::vector<JobEvent> events_;
  std::map<std::string, int64_t> cursors_;
  std::atomic<bool> held_ = true;
  std::atomic<bool> writable_ = true;
  std::atomic<bool> readable_ = true;
};

// Record of a receiver's events, and its behaviour; outlives the receiver.
struct Script {
  std::mutex mutex;
  std::vector<int64_t> got;
  absl::Status answer;     // of every delivery
  absl::Status readiness;  // of KeepReady
  bool blocks = false;     // until it is interrupted
  int attempts = 0;

  std::vector<int64_t> Got() {
    std::lock_guard lock(mutex);
    return got;
  }
  int Attempts() {
    std::lock_guard lock(mutex);
    return attempts;
  }
  void Set(const absl::Status& status) {
    std::lock_guard lock(mutex);
    answer = status;
  }
};

class ScriptedReceiver final : public EventReceiver {
 public:
  ScriptedReceiver(std::string name, Script* script) : name_(std::move(name)), script_(script) {}
  std::string name() override { return name_; }
  void Interrupt() override { interrupted_ = true; }
  absl::Status KeepReady() override {
    std::lock_guard lock(script_->mutex);
    return script_->readiness;
  }
  absl::Status Deliver(const JobEvent& event) override {
    std::unique_lock lock(script_->mutex);
    ++script_->attempts;
    if (script_->blocks) {
      lock.unlock();
      while (!interrupted_) absl::SleepFor(absl::Milliseconds(1));
      return absl::CancelledError("interrupted");
    }
    if (script_->answer.ok()) script_->got.push_back(event.sequence);
    return script_->answer;
  }

 private:
  const std::string name_;
  Script* const script_;
  std::atomic<bool> interrupted_ = false;
};

class EventDeliveryTest : public ::testing::Test {
 protected:
  void SetUp() override {
    before_ = spdlog::default_logger();
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink_));
  }
  void TearDown() override { spdlog::set_default_logger(before_); }

  std::unique_ptr<EventReceiver> One() { return std::make_unique<ScriptedReceiver>("one", &one_); }
  std::unique_ptr<EventReceiver> Two() { return std::make_unique<ScriptedReceiver>("two", &two_); }
  int Logged(const std::string& text) const {
    int count = 0;
    for (const std::string& line : sink_->last_formatted()) {
      if (line.find(text) != std::string::npos) ++count;
    }
    return count;
  }

  FakeEventStore store_;
  Script one_;
  Script two_;
  const std::shared_ptr<spdlog::sinks::ringbuffer_sink_mt> sink_ =
      std::make_shared<spdlog::sinks::ringbuffer_sink_mt>(1000);
  std::shared_ptr<spdlog::logger> before_;
};

TEST_F(EventDeliveryTest, DeliversInOrderAndGoesOnAfterItsCursor) {
  store_.Add(250);  // more than is read at a time
  {
    EventDelivery delivery(&store_, Receivers(One()), QuickRetries());
    WaitUntil([&] { return one_.Got().size() == 250; });
    store_.Add(1);
    WaitUntil([&] { return store_.Cursor("one") == 251; });
    EXPECT_EQ(delivery.receivers()[0].delivered_events, 251);
  }
  EXPECT_TRUE(std::is_sorted(one_.got.begin(), one_.got.end()));
  one_.got.clear();
  store_.Add(2);
  EventDelivery delivery(&store_, Receivers(One()), QuickRetries());
  WaitUntil([&] { return store_.Cursor("one") == 253; });
  EXPECT_THAT(one_.Got(), ElementsAre(252, 253));
}

TEST_F(EventDeliveryTest, FailuresAreRetriedAndLoggedOnce) {
  store_.Add(3);
  one_.answer = absl::UnavailableError("nobody at home");
  EventDelivery delivery(&store_, Receivers(One()), QuickRetries());
  WaitUntil([&] { return one_.Attempts() >= 5; });
  EXPECT_THAT(one_.Got(), IsEmpty());
  EXPECT_TRUE(delivery.receivers()[0].is_failing);
  EXPECT_EQ(store_.Cursor("one"), 0);
  EXPECT_EQ(Logged("nobody at home"), 1);
  one_.Set(absl::OkStatus());
  WaitUntil([&] { return store_.Cursor("one") == 3; });
  EXPECT_THAT(one_.Got(), ElementsAre(1, 2, 3));
  EXPECT_FALSE(delivery.receivers()[0].is_failing);
  EXPECT_EQ(Logged("receiver_recovered"), 1);
  EXPECT_EQ(Logged("receiver_failing"), 1);
}

TEST_F(EventDeliveryTest, BrokenConnectionsAreSeenWithoutEvents) {
  one_.readiness = absl::UnavailableError("no broker");
  EventDelivery delivery(&store_, Receivers(One()), QuickRetries());
  WaitUntil([&] { return delivery.receivers()[0].is_failing; });
  {
    std::lock_guard lock(one_.mutex);
    one_.readiness = absl::OkStatus();
  }
  WaitUntil([&] { return !delivery.receivers()[0].is_failing; });
}

TEST_F(EventDeliveryTest, ReceiversDoNotWaitForEachOther) {
  store_.Add(3);
  one_.blocks = true;
  EventDelivery delivery(&store_, Receivers(One(), Two()), QuickRetries());
  WaitUntil([&] { return store_.Cursor("two") == 3 && one_.Attempts() == 1; });
  EXPECT_EQ(store_.Cursor("one"), 0);
}

TEST_F(EventDeliveryTest, ReceiverThatWantsNoMoreIsLeftAlone) {
  store_.Add(3);
  one_.answer = absl::FailedPreconditionError("gone");
  EventDelivery delivery(&store_, Receivers(One(), Two()), QuickRetries());
  WaitUntil([&] { return delivery.receivers()[0].has_ended; });
  WaitUntil([&] { return store_.Cursor("two") == 3; });
  EXPECT_EQ(one_.Attempts(), 1);
  EXPECT_FALSE(delivery.receivers()[1].has_ended);
  EXPECT_EQ(Logged("receiver_ended"), 1);
}

TEST_F(EventDeliveryTest, StoreThatFailsIsNoEndAndNoRepetition) {
  store_.Add(2);
  store_.SetReadable(false);
  EventDelivery delivery(&store_, Receivers(One()), QuickRetries());
  WaitUntil([&] { return delivery.receivers()[0].is_failing; });
  EXPECT_FALSE(delivery.receivers()[0].has_ended);
  store_.SetWritable(false);
  store_.SetReadable(true);
  WaitUntil([&] { return one_.Got().size() == 1; });
  store_.SetWritable(true);
  WaitUntil([&] { return store_.Cursor("one") == 2; });
  EXPECT_THAT(one_.Got(), ElementsAre(1, 2));
}

TEST_F(EventDeliveryTest, DeliversOnlyWhatItHolds) {
  store_.Add(2);
  store_.SetHeld(false);
  EventDelivery delivery(&store_, Receivers(One()), QuickRetries());
  absl::SleepFor(absl::Milliseconds(100));
  EXPECT_EQ(one_.Attempts(), 0);
  // The process that held it got as far as the first event.
  ASSERT_TRUE(store_.SetEventCursor("one", 1).ok());
  store_.SetHeld(true);
  WaitUntil([&] { return store_.Cursor("one") == 2; });
  EXPECT_THAT(one_.Got(), ElementsAre(2));
}

TEST_F(EventDeliveryTest, StopsWhateverReceiversDo) {
  store_.Add(3);
  one_.blocks = true;
  two_.answer = absl::UnavailableError("nobody at home");
  EventDeliveryOptions patient;
  patient.first_retry_delay = patient.longest_retry_delay = absl::Hours(24);
  EventDelivery delivery(&store_, Receivers(One(), Two()), patient);
  WaitUntil([&] { return one_.Attempts() == 1 && two_.Attempts() == 1; });
  delivery.Stop();
  delivery.Stop();
  EXPECT_EQ(two_.Attempts(), 1);
}

}  // namespace
}  // namespace sightline
