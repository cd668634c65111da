// SPDX-License-Identifier: Apache-2.0
// Reads a set of recordings from a folder.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

struct RecordedFolder {
  std::string folder;
  std::string description_file;          // path of its recordings.json
  v1::Recordings recordings;             // valid
  std::vector<AssetFile> images;         // of the recordings, in their order
  std::vector<std::string> assumptions;  // sentences on values that were not stated
};

enum class Shown { kPlate, kPlateOrPart };
// Treatment of values that a plate's description lacks: an error, or
// AssumeMissingValues.
enum class MissingValues { kError, kAssume };

// `path`: the folder or its recordings.json. NOT_FOUND if the description or images are missing
// (the message names all). INVALID_ARGUMENT names file, field and reason; it is also returned for
// format version 2 (a part) if only plates are supported.
absl::StatusOr<RecordedFolder> ReadRecordedFolder(const std::string& path,
                                                  Shown shown = Shown::kPlateOrPart,
                                                  MissingValues missing = MissingValues::kError);

}  // namespace sightline
