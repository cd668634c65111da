// SPDX-License-Identifier: Apache-2.0
// Client of a render worker: one request, its files into a folder.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

struct RenderClientOptions : WorkerClientOptions {
  std::function<void(const std::string& warning)> on_warning;
  // The file that lists the finished images; the same request with the same file and folder
  // makes only the others. Empty: nowhere.
  // Images that are listed in other files of that folder, whose names begin like this one's, count
  // as finished as well.
  std::string checkpoint_file;
  // Makes only every `part_count`-th image, of number `part` (from 0) first, and no
  // recordings.json.
  int part = 0;
  int part_count = 1;
};

// Uploads missing files, renders, and writes every file into `folder` once it is
// complete and its digest is right: under another name first, then renamed. recordings.json comes
// last, so that a folder that has one has all its images. Returns the files' names. UNAVAILABLE:
// the worker ended; the message says how. CANCELLED: interrupted. Other errors are the worker's.
absl::StatusOr<std::vector<std::string>> RenderToFolder(const RenderClientOptions& options,
                                                        v1::RenderSpec spec,
                                                        const std::vector<AssetFile>& assets,
                                                        const std::string& folder);

}  // namespace sightline
