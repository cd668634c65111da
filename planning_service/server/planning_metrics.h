// SPDX-License-Identifier: Apache-2.0
// Prometheus metrics of the planning service: waiting, running and ended jobs.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "planning_service/job_store/planning_job_store.h"
#include "rpc_server/server_metrics.h"

namespace sightline {

// Every scrape reads the jobs from the store, so that the numbers are right whichever process runs
// them. Ends of jobs are counted from the store's events since this process began. Services that
// share a database all show the same jobs. Thread-safe.
class PlanningMetrics final : public ServerMetrics {
 public:
  PlanningMetrics();

  // Sets the store that scrapes read; it must outlive them. Before that they show only calls.
  void SetStore(PlanningJobStore* store);

  std::shared_ptr<prometheus::Collectable> collectable() override { return collectable_; }

  // Updates all values; `sightline_job_store_up` is 1 if the store has answered.
  void Refresh();

 private:
  class OnScrape;

  absl::Status ReadStore();
  absl::Status CountEnded();

  prometheus::Gauge& store_up_;
  prometheus::Gauge& queued_;
  prometheus::Gauge& running_;
  prometheus::Gauge& stored_bytes_;
  prometheus::Family<prometheus::Counter>& ended_;
  prometheus::Family<prometheus::Counter>& attempts_;
  prometheus::Family<prometheus::Histogram>& seconds_;
  std::shared_ptr<prometheus::Collectable> collectable_;
  std::mutex mutex_;
  PlanningJobStore* store_ = nullptr;
  std::optional<int64_t> last_event_;  // the last one counted
};

}  // namespace sightline
