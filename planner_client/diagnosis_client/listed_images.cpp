#include "planner_client/diagnosis_client/listed_images.h"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostNamed = 5;

}  // namespace

absl::StatusOr<std::vector<AssetFile>> ReadListedImages(const std::string& folder,
                                                        const std::vector<ListedImage>& images,
                                                        const std::string& list) {
  std::vector<AssetFile> read;
  std::string names;
  size_t missing = 0;
  for (const ListedImage& image : images) {
    const fs::path path = fs::path(folder) / image.file;
    std::error_code error;
    std::ifstream stream;
    // What is no file, such as a pipe, could block when opened.
    if (fs::is_regular_file(path, error)) stream.open(path, std::ios::binary);
    std::ostringstream bytes;
    if (stream.is_open()) bytes << stream.rdbuf();
    if (!stream.is_open() || stream.bad()) {
      if (++missing > kMostNamed) continue;
      absl::StrAppend(&names, names.empty() ? "" : ", ", image.file,
                      image.place.empty() ? "" : absl::StrCat(" (", image.place, ")"));
      continue;
    }
    std::string contents = std::move(bytes).str();
    if (contents.empty()) {
      return absl::InvalidArgumentError(absl::StrCat(path.string(), ": is empty"));
    }
    // The bytes of a set that cannot be used are not kept.
    if (missing == 0) read.push_back({image.file, std::move(contents)});
  }
  if (missing == 0) return read;
  if (missing > kMostNamed) absl::StrAppend(&names, " and ", missing - kMostNamed, " more");
  return absl::NotFoundError(
      absl::StrCat(list, ": ", missing, " of ", images.size(), " images cannot be read: ", names));
}

}  // namespace sightline
