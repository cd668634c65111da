// SPDX-License-Identifier: Apache-2.0
#include "planning_service/server/planning_metrics.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "core/status/status_macros.h"

namespace sightline {
namespace {

const prometheus::Histogram::BucketBoundaries kJobBuckets_s = {
    1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600, 2 * 3600, 6 * 3600, 24 * 3600};
// Most events per query and most queries per scrape; the next scrape counts the rest.
constexpr int kEventsPerPage = 1000;
constexpr int kMostPages = 50;

// Type of the event of a job that ended, and the name of how it ended.
const std::map<std::string, std::string>& Outcomes() {
  static const std::map<std::string, std::string> outcomes = {
      {"done", "succeeded"}, {"failed", "failed"}, {"cancelled", "cancelled"}};
  return outcomes;
}

// Sequence of the newest event; 0: there is none. Bisection, because the store may keep millions.
absl::StatusOr<int64_t> NewestEvent(PlanningJobStore* store) {
  int64_t low = 0;
  int64_t high = std::numeric_limits<int64_t>::max() / 2;
  while (low < high) {
    const int64_t middle = low + (high - low) / 2;
    SIGHTLINE_ASSIGN_OR_RETURN(const auto later, store->Events(middle, std::nullopt, 1));
    if (later.empty()) {
      high = middle;
    } else {
      low = later.front().sequence;
    }
  }
  return low;
}

}  // namespace

class PlanningMetrics::OnScrape final : public prometheus::Collectable {
 public:
  explicit OnScrape(PlanningMetrics* metrics) : metrics_(metrics) {}
  std::vector<prometheus::MetricFamily> Collect() const override {
    metrics_->Refresh();
    return metrics_->registry()->Collect();
  }

 private:
  PlanningMetrics* const metrics_;
};

PlanningMetrics::PlanningMetrics()
    : store_up_(AddGauge("sightline_job_store_up", "1: the job store answers")),
      queued_(AddGauge("sightline_jobs_queued", "Jobs that wait")),
      running_(AddGauge("sightline_jobs_running", "Jobs that run")),
      stored_bytes_(
          AddGauge("sightline_stored_bytes", "Bytes of uploads, and files and results of jobs")),
      ended_(prometheus::BuildCounter()
                 .Name("sightline_jobs_total")
                 .Help("Jobs that ended, by kind and outcome")
                 .Register(*registry())),
      attempts_(prometheus::BuildCounter()
                    .Name("sightline_job_attempts_total")
                    .Help("Attempts of ended jobs, including attempts that broke off")
                    .Register(*registry())),
      seconds_(prometheus::BuildHistogram()
                   .Name("sightline_job_seconds")
                   .Help("Time from the last start to the end of jobs that succeeded, by kind")
                   .Register(*registry())),
      collectable_(std::make_shared<OnScrape>(this)) {}

void PlanningMetrics::SetStore(PlanningJobStore* store) {
  std::lock_guard lock(mutex_);
  store_ = store;
  const auto newest = NewestEvent(store);
  if (newest.ok()) last_event_ = *newest;
}

void PlanningMetrics::Refresh() {
  std::lock_guard lock(mutex_);
  if (store_ == nullptr) return;
  const absl::Status status = ReadStore();
  store_up_.Set(status.ok() ? 1 : 0);
  if (!status.ok()) spdlog::warn("event=metrics_incomplete message={:?}", status.ToString());
}

absl::Status PlanningMetrics::ReadStore() {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto counts, store_->Count(std::nullopt));
  queued_.Set(counts.queued);
  running_.Set(counts.running);
  stored_bytes_.Set(static_cast<double>(counts.stored_bytes));
  if (!last_event_) {
    SIGHTLINE_ASSIGN_OR_RETURN(last_event_, NewestEvent(store_));
  }
  return CountEnded();
}

absl::Status PlanningMetrics::CountEnded() {
  for (int page = 0; page < kMostPages; ++page) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto events,
                               store_->Events(*last_event_, std::nullopt, kEventsPerPage));
    for (const JobEvent& event : events) {
      if (const auto outcome = Outcomes().find(event.type); outcome != Outcomes().end()) {
        const std::string& kind = event.job.kind;
        ended_.Add({{"kind", kind}, {"outcome", outcome->second}}).Increment();
        attempts_.Add({{"kind", kind}}).Increment(event.job.attempts);
        // Events do not hold times; the job does, unless retention has removed it.
        if (const auto job = store_->Get(event.job.job_id);
            job.ok() && job->state == JobState::kSucceeded) {
          seconds_.Add({{"kind", kind}}, kJobBuckets_s)
              .Observe(std::max(0.0, absl::ToDoubleSeconds(job->finished - job->started)));
        }
      }
      last_event_ = event.sequence;
    }
    if (events.size() < static_cast<size_t>(kEventsPerPage)) break;
  }
  return absl::OkStatus();
}

}  // namespace sightline
