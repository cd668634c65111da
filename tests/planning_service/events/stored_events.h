// SPDX-License-Identifier: Apache-2.0
// Jobs in a real store, and what the tests of receivers share.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "planning_service/events/event_delivery.h"
#include "planning_service/job_store/planning_job_store.h"

namespace sightline {

class TestFolder {
 public:
  TestFolder() { EXPECT_NE(mkdtemp(path_.data()), nullptr); }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  const std::string& path() const { return path_; }
  // Path of a new file that only we can read.
  std::string Write(const std::string& name, const std::string& text) const {
    const std::string path = path_ + "/" + name;
    std::ofstream(path) << text;
    std::filesystem::permissions(
        path, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    return path;
  }

 private:
  std::string path_ = "/tmp/sightline-events-XXXXXX";
};

class StoredEvents {
 public:
  explicit StoredEvents(const TestFolder& folder) : file_(folder.path() + "/jobs.db") { Open(); }

  PlanningJobStore* store() { return store_.get(); }
  // As after a restart of the service.
  void Reopen() {
    store_.reset();
    Open();
  }

  // A job with an event; returns its id.
  std::string AddJob() {
    NewPlanningJob job;
    job.client = "mes";
    job.kind = "plan";
    job.fingerprint = absl::StrCat("fingerprint ", ++jobs_);
    job.task = "task";
    const auto created = store_->Create(job, ClientQuota{});
    EXPECT_TRUE(created.ok()) << created.status();
    return created.ok() ? created->job_id : "";
  }
  // Runs the oldest job to its end.
  std::string FinishJob() {
    const auto claimed = store_->Claim([](const std::string&) { return ClientQuota{}; });
    EXPECT_TRUE(claimed.ok() && claimed->has_value()) << claimed.status();
    if (!claimed.ok() || !claimed->has_value()) return "";
    const PlanningJob& job = **claimed;
    const JobFile result{"plan.json", std::string(64, 'a'), 17};
    const absl::Status done = store_->Succeed({job.job_id, job.attempts}, {result});
    EXPECT_TRUE(done.ok()) << done;
    return job.job_id;
  }
  std::vector<JobEvent> All() {
    const auto events = store_->Events(0, std::nullopt, 10000);
    EXPECT_TRUE(events.ok()) << events.status();
    return events.ok() ? *events : std::vector<JobEvent>{};
  }
  std::vector<std::string> AllIds() {
    std::vector<std::string> ids;
    for (const JobEvent& event : All()) ids.push_back(absl::StrCat(event.sequence));
    return ids;
  }

 private:
  void Open() {
    auto store = OpenSqliteJobStore(file_);
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
  }

  const std::string file_;
  std::unique_ptr<PlanningJobStore> store_;
  int jobs_ = 0;
};

inline std::vector<std::unique_ptr<EventReceiver>> Receivers(
    std::unique_ptr<EventReceiver> first, std::unique_ptr<EventReceiver> second = nullptr) {
  std::vector<std::unique_ptr<EventReceiver>> receivers;
  receivers.push_back(std::move(first));
  if (second != nullptr) receivers.push_back(std::move(second));
  return receivers;
}

inline EventDeliveryOptions QuickRetries() {
  EventDeliveryOptions options;
  options.first_retry_delay = absl::Milliseconds(10);
  options.longest_retry_delay = absl::Milliseconds(100);
  return options;
}

// The events that a receiver keeps by the rule of docs/clients.md: delivery is at least once
// and in order, so what is not greater than all before is a repetition. A broker that restarts
// sends again all that its listener has not acknowledged (MQTT 3.1.1, 4.6: 1, 2, 3, 2, 3, 4). An
// event that comes after a greater one is missing from the answer.
inline std::vector<std::string> WithoutRepetitions(const std::vector<std::string>& ids) {
  std::vector<std::string> kept;
  int64_t largest = 0;
  for (const std::string& id : ids) {
    int64_t number = 0;
    EXPECT_TRUE(absl::SimpleAtoi(id, &number)) << id;
    if (number <= largest) continue;
    largest = number;
    kept.push_back(id);
  }
  return kept;
}

}  // namespace sightline
