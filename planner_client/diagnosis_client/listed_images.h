// SPDX-License-Identifier: Apache-2.0
// Reads the images that a description lists, from its folder.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"

namespace sightline {

struct ListedImage {
  std::string file;   // relative to the folder
  std::string place;  // place in the description, for errors; may be empty
};

// The images in the order of the list. `list`: file and field of the description, which begin error
// messages. NOT_FOUND if images cannot be read; the message counts them and names up to five.
// INVALID_ARGUMENT if an image is empty.
absl::StatusOr<std::vector<AssetFile>> ReadListedImages(const std::string& folder,
                                                        const std::vector<ListedImage>& images,
                                                        const std::string& list);

}  // namespace sightline
