// SPDX-License-Identifier: Apache-2.0
// Renders all images of one request into a folder as a set of recordings.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/recordings/recordings.h"
#include "render_worker/material/material.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

// A complete file.
struct RenderedFile {
  std::string file;  // path in the folder
  int64_t size_bytes = 0;
  std::string sha256;  // lower-case hex
  int image = -1;      // number of its frame or recording; recordings.json: -1
};

// Callbacks of a running task, called from its thread.
struct RenderTaskHooks {
  std::function<void(RenderedFile file)> on_file;
  std::function<void(const std::string& warning)> on_warning;
  std::function<void(double fraction, const std::string& message)> on_progress;
  const std::atomic<bool>* cancelled = nullptr;
  int threads = 1;
  int64_t max_image_bytes = int64_t{8} << 30;
};

class RenderTask {
 public:
  // Checks the request without reading any asset. INVALID_ARGUMENT lists missing or invalid fields
  // as field violations; RESOURCE_EXHAUSTED (reason IMAGE_TOO_LARGE): an image would need more than
  // `max_image_bytes`.
  static absl::StatusOr<std::unique_ptr<RenderTask>> Parse(const v1::RenderSpec& spec,
                                                           int64_t max_image_bytes);
  virtual ~RenderTask() = default;

  // Names of the files that it reads, as in the request.
  virtual std::vector<std::string> AssetFiles() const = 0;
  virtual int frames() const = 0;

  // Renders all images that the request does not list as finished into the existing `folder`;
  // recordings.json comes last. Every file appears complete. INVALID_ARGUMENT, NOT_FOUND: a broken
  // asset; CANCELLED.
  virtual absl::Status Run(const std::string& folder, const AssetResolver& assets,
                           const RenderTaskHooks& hooks) = 0;
};

}  // namespace sightline
