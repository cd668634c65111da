// SPDX-License-Identifier: Apache-2.0
// Finished files of render jobs on disk, until they are too many or too old.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "render_worker/render/render_task.h"

namespace sightline {

// Files and warnings of one job, growing while it runs. Thread-safe. Its folder is made when the
// job starts, and goes with this.
class RenderOutput {
 public:
  explicit RenderOutput(std::string folder);
  ~RenderOutput();
  RenderOutput(const RenderOutput&) = delete;
  RenderOutput& operator=(const RenderOutput&) = delete;

  const std::string& folder() const { return folder_; }
  // RESOURCE_EXHAUSTED: it cannot be made.
  absl::Status MakeFolder() const;
  // After a job that made nothing.
  void RemoveFolder() const;
  // The job has ended: its files are kept for a time from now on.
  void Finish();
  // Whether it ended that long ago.
  bool FinishedBefore(absl::Duration age) const;
  // The output is not wanted any more.
  void Discard() { discarded_ = true; }
  bool discarded() const { return discarded_; }
  void AddFile(RenderedFile file);
  void AddWarning(const std::string& warning);
  // Files from number `first` on.
  std::vector<RenderedFile> FilesFrom(size_t first) const;
  std::vector<std::string> WarningsFrom(size_t first) const;
  int64_t bytes() const;

 private:
  const std::string folder_;
  mutable std::mutex mutex_;
  std::vector<RenderedFile> files_;
  std::vector<std::string> warnings_;
  int64_t bytes_ = 0;
  std::optional<std::chrono::steady_clock::time_point> finished_;
  std::atomic<bool> discarded_ = false;
};

// Thread-safe.
class RenderOutputStore {
 public:
  // `keep`: how long files are kept after their job has ended.
  explicit RenderOutputStore(int64_t max_bytes, absl::Duration keep = absl::InfiniteDuration())
      : max_bytes_(max_bytes), keep_(keep) {}

  // Nothing happens if the job had an output before, even if that was dropped since, or if the
  // output was discarded meanwhile.
  void Add(const std::string& job_id, std::shared_ptr<RenderOutput> output);
  // Null if unknown or dropped.
  std::shared_ptr<RenderOutput> Get(const std::string& job_id) const;
  // Drops discarded and too old outputs, and the oldest ones beyond the limits on bytes and
  // on number, but not the newest one. Who streams from one keeps it alive.
  void Trim();

 private:
  const int64_t max_bytes_;
  const absl::Duration keep_;
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<RenderOutput>> outputs_;
  std::deque<std::string> order_;  // oldest first
  std::set<std::string> known_;    // added before, as far as jobs are remembered
  std::deque<std::string> known_order_;
};

}  // namespace sightline
