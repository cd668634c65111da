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
  // File that lists finished images. With the same request, file and
  // folder, only the missing ones are made. Images in other lists of that
  // folder whose names begin alike count as finished, too. Empty: no
  // list.
  std::string checkpoint_file;
  // Makes only every `part_count`-th image, starting with number `part` (from 0), and no
  // recordings.json.
  int part = 0;
  int part_count = 1;
};

// Uploads missing files, renders, and writes every file into `folder` once it is complete and its
// digest agrees: first under another name, then renamed. recordings.json comes last, so a folder
// that has it has all images. Returns the files' names. UNAVAILABLE: the worker ended; the message
// says how. CANCELLED: interrupted. Other errors are the worker's.
absl::StatusOr<std::vector<std::string>> RenderToFolder(const RenderClientOptions& options,
                                                        v1::RenderSpec spec,
                                                        const std::vector<AssetFile>& assets,
                                                        const std::string& folder);

}  // namespace sightline
