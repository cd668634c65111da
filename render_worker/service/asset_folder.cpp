// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/asset_folder.h"

#include <filesystem>
#include <system_error>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "proto/status/rpc_status.h"
#include "render_worker/service/without_folders.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

std::string Normalised(const std::string& file) { return fs::path(file).lexically_normal(); }

}  // namespace

AssetFolder::~AssetFolder() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

absl::Status AssetFolder::Add(const google::protobuf::RepeatedPtrField<v1::RenderAsset>& assets,
                              const std::string& field, AssetStore* store) {
  for (int i = 0; i < assets.size(); ++i) {
    const v1::RenderAsset& asset = assets[i];
    const std::string path = absl::StrCat(field, "[", i, "].file");
    const std::string quoted = absl::StrCat("is \"", absl::Utf8SafeCEscape(asset.file()), "\", ");
    const std::string name = Normalised(asset.file());
    if (name.empty() || name[0] == '/' || absl::StartsWith(name, "..")) {
      return InvalidFields({{path, quoted + "must be a relative name without .."}});
    }
    auto stored = store->Get(asset.asset_digest());
    if (stored == nullptr) {
      return WithErrorInfo(
          absl::NotFoundError(absl::StrCat("asset ", asset.file(), " (", asset.asset_digest(),
                                           ") must be uploaded first")),
          "ASSET_UNKNOWN", {{"file", asset.file()}, {"asset_digest", asset.asset_digest()}});
    }
    if (!assets_.emplace(name, std::move(stored)).second) {
      return InvalidFields({{path, quoted + "which is there twice"}});
    }
  }
  return absl::OkStatus();
}

bool AssetFolder::Has(const std::string& file) const { return assets_.count(Normalised(file)) > 0; }

absl::StatusOr<std::string> AssetFolder::Resolve(const std::string& file) const {
  const fs::path name = Normalised(file);
  const auto asset = assets_.find(name.string());
  if (asset == assets_.end()) {
    return absl::NotFoundError(absl::StrCat(file, ": is not among the assets of the request"));
  }
  const fs::path link = fs::path(folder_) / name;
  std::error_code error;
  fs::create_directories(link.parent_path(), error);
  if (!error) fs::permissions(folder_, fs::perms::owner_all, error);
  fs::create_symlink(asset->second->path(), link, error);
  if (error && !fs::is_symlink(link)) {
    return absl::InternalError(absl::StrCat(file, ": cannot be opened: ", error.message()));
  }
  return link.string();
}

std::string AssetFolder::WithoutFolder(const std::string& message) const {
  return WithoutFolders(message, {folder_});
}

absl::Status AssetFolder::WithoutFolder(const absl::Status& status) const {
  return WithoutFolders(status, {folder_});
}

}  // namespace sightline
