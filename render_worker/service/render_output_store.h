// SPDX-License-Identifier: Apache-2.0
// Finished files of render jobs on disk, limited in number, size and age.
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

// Files and warnings of one job, which grow while it runs. Thread-safe. Its folder is made when the
// job starts, and removed with this object.
class RenderOutput {
 public:
  explicit RenderOutput(std::string folder);
  ~RenderOutput();
  RenderOutput(const RenderOutput&) = delete;
  RenderOutput& operator=(const RenderOutput&) = delete;

  const std::string& folder() const { return folder_; }
  // RESOURCE_EXHAUSTED if the folder cannot be made.
  absl::Status MakeFolder() const;
  // Removes the folder after a job without files.
  void RemoveFolder() const;
  // Marks the job as ended: the age of its files counts from now.
  void Finish();
  // True if the job ended at least `age` ago.
  bool FinishedBefore(absl::Duration age) const;
  // Marks the output as no longer needed.
  void Discard() { discarded_ = true; }
  bool discarded() const { return discarded_; }
  void AddFile(RenderedFile file);
  void AddWarning(const std::string& warning);
  // Files with index `first` and above.
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
  // `keep`: maximum age of files after the end of their job.
  explicit RenderOutputStore(int64_t max_bytes, absl::Duration keep = absl::InfiniteDuration())
      : max_bytes_(max_bytes), keep_(keep) {}

  // Does nothing if the job already had an output, even if that was dropped since, or if the output
  // was discarded meanwhile.
  void Add(const std::string& job_id, std::shared_ptr<RenderOutput> output);
  // Null if unknown or dropped.
  std::shared_ptr<RenderOutput> Get(const std::string& job_id) const;
  // Drops discarded and expired outputs, and the oldest ones beyond the limits of size and number,
  // except the newest. A stream from an output keeps it alive.
  void Trim();

 private:
  const int64_t max_bytes_;
  const absl::Duration keep_;
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<RenderOutput>> outputs_;
  std::deque<std::string> order_;  // oldest first
  std::set<std::string> known_;    // jobs added before, as far as jobs are remembered
  std::deque<std::string> known_order_;
};

}  // namespace sightline
