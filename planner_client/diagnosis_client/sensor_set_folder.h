// SPDX-License-Identifier: Apache-2.0
// Reads flat-field and dark frames of a camera from a folder.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

struct SensorSetFolder {
  std::string folder;
  std::string description_file;   // path of its EMVA 1288 data file
  v1::SensorSet set;              // valid; its name is the folder's if the file gives none
  std::vector<AssetFile> images;  // of the steps, in their order
};

// True if `path` is a .txt file, or a folder with an EMVA 1288 data file (its name in lower or
// upper case) and no recordings.json. The file itself is not read.
bool IsSensorSet(const std::string& path);

// `path`: the folder or its data file, any .txt. NOT_FOUND if the data file or images are missing
// (names up to five with their step). INVALID_ARGUMENT names the file and the reason: more than 16
// MB, an error of ParseEmva1288Data, or an image path that leads out of the folder.
absl::StatusOr<SensorSetFolder> ReadSensorSetFolder(const std::string& path);

}  // namespace sightline
