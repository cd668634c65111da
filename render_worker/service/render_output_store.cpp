// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/render_output_store.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/job/job_store.h"

namespace sightline {
namespace {

// As many as jobs are remembered: older ones cannot be requested.
constexpr size_t kMostOutputs = kKeptFinishedJobs;
// With room for those that have not finished.
constexpr size_t kMostKnown = 4 * kMostOutputs;

}  // namespace

RenderOutput::RenderOutput(std::string folder) : folder_(std::move(folder)) {}

RenderOutput::~RenderOutput() { RemoveFolder(); }

absl::Status RenderOutput::MakeFolder() const {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  // The images are a client's own.
  if (!error) {
    std::filesystem::permissions(folder_, std::filesystem::perms::owner_all, error);
  }
  if (!error) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("no folder for the images can be made: ", error.message()));
}

void RenderOutput::RemoveFolder() const {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

void RenderOutput::Finish() {
  std::lock_guard lock(mutex_);
  finished_ = std::chrono::steady_clock::now();
}

bool RenderOutput::FinishedBefore(absl::Duration age) const {
  std::lock_guard lock(mutex_);
  return finished_ && absl::FromChrono(std::chrono::steady_clock::now() - *finished_) >= age;
}

void RenderOutput::AddFile(RenderedFile file) {
  std::lock_guard lock(mutex_);
  bytes_ += file.size_bytes;
  files_.push_back(std::move(file));
}

void RenderOutput::AddWarning(const std::string& warning) {
  std::lock_guard lock(mutex_);
  warnings_.push_back(warning);
}

std::vector<RenderedFile> RenderOutput::FilesFrom(size_t first) const {
  std::lock_guard lock(mutex_);
  if (first >= files_.size()) return {};
  return {files_.begin() + static_cast<std::ptrdiff_t>(first), files_.end()};
}

std::vector<std::string> RenderOutput::WarningsFrom(size_t first) const {
  std::lock_guard lock(mutex_);
  if (first >= warnings_.size()) return {};
  return {warnings_.begin() + static_cast<std::ptrdiff_t>(first), warnings_.end()};
}

int64_t RenderOutput::bytes() const {
  std::lock_guard lock(mutex_);
  return bytes_;
}

void RenderOutputStore::Add(const std::string& job_id, std::shared_ptr<RenderOutput> output) {
  std::lock_guard lock(mutex_);
  if (!known_.insert(job_id).second) return;
  known_order_.push_back(job_id);
  if (known_order_.size() > kMostKnown) {
    known_.erase(known_order_.front());
    known_order_.pop_front();
  }
  if (output->discarded()) return;
  outputs_[job_id] = std::move(output);
  order_.push_back(job_id);
}

std::shared_ptr<RenderOutput> RenderOutputStore::Get(const std::string& job_id) const {
  std::lock_guard lock(mutex_);
  const auto found = outputs_.find(job_id);
  return found == outputs_.end() ? nullptr : found->second;
}

void RenderOutputStore::Trim() {
  std::vector<std::shared_ptr<RenderOutput>> dropped;
  std::lock_guard lock(mutex_);
  int64_t bytes = 0;
  for (auto it = order_.begin(); it != order_.end();) {
    const auto found = outputs_.find(*it);
    if (!found->second->discarded() && !found->second->FinishedBefore(keep_)) {
      bytes += found->second->bytes();
      ++it;
      continue;
    }
    dropped.push_back(std::move(found->second));
    outputs_.erase(found);
    it = order_.erase(it);
  }
  while ((bytes > max_bytes_ && order_.size() > 1) || order_.size() > kMostOutputs) {
    const auto oldest = outputs_.find(order_.front());
    bytes -= oldest->second->bytes();
    dropped.push_back(std::move(oldest->second));
    outputs_.erase(oldest);
    order_.pop_front();
  }
}

}  // namespace sightline
