// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/listed_images.h"

#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostNamed = 5;
constexpr uint64_t kMaxImageFileBytes = uint64_t{1} << 30;

}  // namespace

absl::StatusOr<std::vector<AssetFile>> ReadListedImages(const std::string& folder,
                                                        const std::vector<ListedImage>& images,
                                                        const std::string& list) {
  std::vector<AssetFile> read;
  std::string names;
  size_t missing = 0;
  for (const ListedImage& image : images) {
    const fs::path path = fs::path(folder) / image.file;
    absl::StatusOr<std::string> contents = ReadRegularFile(path.string(), kMaxImageFileBytes);
    std::error_code error;
    if (!contents.ok() && fs::is_regular_file(path, error) &&
        absl::IsInvalidArgument(contents.status())) {
      return contents.status();  // too large
    }
    if (!contents.ok()) {
      if (++missing > kMostNamed) continue;
      absl::StrAppend(&names, names.empty() ? "" : ", ", image.file,
                      image.place.empty() ? "" : absl::StrCat(" (", image.place, ")"));
      continue;
    }
    if (contents->empty()) {
      return absl::InvalidArgumentError(absl::StrCat(path.string(), ": is empty"));
    }
    // The bytes of a set that cannot be used are not kept.
    if (missing == 0) read.push_back({image.file, *std::move(contents)});
  }
  if (missing == 0) return read;
  if (missing > kMostNamed) absl::StrAppend(&names, " and ", missing - kMostNamed, " more");
  return absl::NotFoundError(
      absl::StrCat(list, ": ", missing, " of ", images.size(), " images cannot be read: ", names));
}

}  // namespace sightline
