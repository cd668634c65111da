// A set of recordings as a folder on disk.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

struct RecordedFolder {
  std::string folder;
  std::string description_file;   // path of its recordings.json
  v1::Recordings recordings;      // format version 1, valid
  std::vector<AssetFile> images;  // of the recordings, in their order
};

// `path`: the folder or its recordings.json. NOT_FOUND: no description, or images are missing (all
// are named); INVALID_ARGUMENT names file, field and reason; also for format version 2, a part.
absl::StatusOr<RecordedFolder> ReadRecordedFolder(const std::string& path);

}  // namespace sightline
