// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/housekeeping.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <filesystem>
#include <utility>
#include <vector>

#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// A younger file that nothing names may belong to a job that is being created.
constexpr absl::Duration kLeastFileAge = absl::Hours(1);

}  // namespace

Housekeeping::Housekeeping(HousekeepingOptions options, PlanningJobStore* store,
                           ArtefactStore* artefacts)
    : options_(std::move(options)),
      store_(store),
      artefacts_(artefacts),
      thread_([this] { Work(); }) {}

Housekeeping::~Housekeeping() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  thread_.join();
}

absl::Status Housekeeping::RemoveOld() {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto removed, store_->RemoveOlderThan(options_.keep_finished));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto named, store_->NamedDigests());
  SIGHTLINE_ASSIGN_OR_RETURN(const auto freed, artefacts_->RemoveAllBut(named, kLeastFileAge));
  if (removed > 0 || freed > 0) {
    spdlog::info("event=removed_old jobs={} bytes={}", removed, freed);
  }
  std::error_code error;
  std::vector<fs::path> folders;
  for (auto entry = fs::directory_iterator(options_.work_folder, error);
       !error && entry != fs::directory_iterator(); entry.increment(error)) {
    folders.push_back(entry->path());
  }
  for (const fs::path& folder : folders) {
    const auto job = store_->Get(folder.filename().string());
    if (absl::IsNotFound(job.status()) || (job.ok() && job->IsFinished())) {
      fs::remove_all(folder, error);
    }
  }
  return absl::OkStatus();
}

void Housekeeping::Work() {
  using Clock = std::chrono::steady_clock;
  Clock::time_point last = Clock::now();
  absl::Duration since_removal = absl::InfiniteDuration();
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    const Clock::time_point now = Clock::now();
    const absl::Duration passed = absl::FromChrono(now - last);
    if (absl::Status s = store_->AdvanceServiceTime(passed); s.ok()) {
      last = now;
    } else {
      spdlog::warn("event=housekeeping_failed error=\"{}\"", s.ToString());
    }
    if (const auto orphans = store_->RequeueOrphans(); !orphans.ok()) {
      spdlog::warn("event=housekeeping_failed error=\"{}\"", orphans.status().ToString());
    } else if (*orphans > 0) {
      spdlog::info("event=requeued_orphans jobs={}", *orphans);
    }
    since_removal += passed;
    if (since_removal >= options_.removal_interval) {
      since_removal = absl::ZeroDuration();
      if (absl::Status s = RemoveOld(); !s.ok()) {
        spdlog::warn("event=housekeeping_failed error=\"{}\"", s.ToString());
      }
    }
    lock.lock();
    stop_.wait_for(lock, absl::ToChronoMilliseconds(options_.interval),
                   [this] { return stopping_; });
  }
}

}  // namespace sightline
