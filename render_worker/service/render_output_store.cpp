#include "render_worker/service/render_output_store.h"

#include <filesystem>
#include <system_error>
#include <utility>

namespace sightline {

RenderOutput::RenderOutput(std::string folder) : folder_(std::move(folder)) {}

RenderOutput::~RenderOutput() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
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
  for (const auto& [job_id, output] : outputs_) bytes += output->bytes();
  while (bytes > max_bytes_ && order_.size() > 1) {
    const auto oldest = outputs_.find(order_.front());
    bytes -= oldest->second->bytes();
    dropped.push_back(std::move(oldest->second));
    outputs_.erase(oldest);
    order_.pop_front();
  }
}

}  // namespace sightline
