// SPDX-License-Identifier: Apache-2.0
// Assets of one request under the names in the request.
#pragma once

#include <google/protobuf/repeated_ptr_field.h>

#include <map>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "render_worker/service/asset_store.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

// Keeps the assets alive. Its folder is made when the first file is requested, and removed with it.
class AssetFolder {
 public:
  explicit AssetFolder(std::string folder) : folder_(std::move(folder)) {}
  ~AssetFolder();
  AssetFolder(const AssetFolder&) = delete;
  AssetFolder& operator=(const AssetFolder&) = delete;

  // NOT_FOUND, reason ASSET_UNKNOWN: an asset must be uploaded first. INVALID_ARGUMENT: a name is
  // not relative, leaves the folder, or is used twice. `field`: path of the list, for messages.
  absl::Status Add(const google::protobuf::RepeatedPtrField<v1::RenderAsset>& assets,
                   const std::string& field, AssetStore* store);

  bool Has(const std::string& file) const;
  int size() const { return static_cast<int>(assets_.size()); }
  // Path of an added file. NOT_FOUND: there is no such file.
  absl::StatusOr<std::string> Resolve(const std::string& file) const;
  // Replaces paths in the message by the client's own names of its files.
  std::string WithoutFolder(const std::string& message) const;
  absl::Status WithoutFolder(const absl::Status& status) const;

 private:
  const std::string folder_;
  std::map<std::string, std::shared_ptr<const Asset>> assets_;  // by normalised name
};

}  // namespace sightline
