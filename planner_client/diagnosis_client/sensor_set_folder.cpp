// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/sensor_set_folder.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/sensor/emva1288_data.h"
#include "core/status/status_macros.h"
#include "planner_client/diagnosis_client/listed_images.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr uintmax_t kMostBytes = 16 << 20;

// The data file in a folder; its exact name goes before other spellings.
std::optional<fs::path> DataFileIn(const fs::path& folder) {
  std::error_code error;
  if (const fs::path usual = folder / kEmva1288DataFile; fs::is_regular_file(usual, error)) {
    return usual;
  }
  std::vector<fs::path> found;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code none;
    if (absl::EqualsIgnoreCase(entry->path().filename().string(), kEmva1288DataFile) &&
        entry->is_regular_file(none)) {
      found.push_back(entry->path());
    }
  }
  if (found.empty()) return std::nullopt;
  return *std::min_element(found.begin(), found.end());
}

// The folder itself is given away with the images; what lies beside it is not.
bool StaysInFolder(const std::string& file) {
  const bool drive = file.size() >= 2 && absl::ascii_isalpha(static_cast<unsigned char>(file[0])) &&
                     file[1] == ':';
  const fs::path path = file;
  return !drive && !path.is_absolute() &&
         std::none_of(path.begin(), path.end(), [](const fs::path& part) { return part == ".."; });
}

absl::StatusOr<std::string> ReadText(const std::string& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    return absl::NotFoundError(absl::StrCat(path, ": cannot be read"));
  }
  const uintmax_t bytes = fs::file_size(path, error);
  if (!error && bytes > kMostBytes) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": has ", bytes,
                                                   " bytes, must have at most ", kMostBytes,
                                                   "; is it a list of images?"));
  }
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  // An empty file sets the stream's failbit, which is no error here.
  if (stream.is_open()) text << stream.rdbuf();
  if (!stream.is_open() || stream.bad()) {
    return absl::NotFoundError(absl::StrCat(path, ": cannot be read"));
  }
  return std::move(text).str();
}

}  // namespace

bool IsSensorSet(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    return !fs::exists(fs::path(path) / "recordings.json", error) && DataFileIn(path).has_value();
  }
  return absl::EndsWithIgnoreCase(path, ".txt");
}

absl::StatusOr<SensorSetFolder> ReadSensorSetFolder(const std::string& path) {
  SensorSetFolder set;
  std::error_code error;
  fs::path description = path;
  if (fs::is_directory(path, error)) {
    description = DataFileIn(path).value_or(fs::path(path) / kEmva1288DataFile);
  }
  set.description_file = description.string();
  set.folder = description.has_parent_path() ? description.parent_path().string() : ".";
  SIGHTLINE_ASSIGN_OR_RETURN(const auto text, ReadText(set.description_file));
  SIGHTLINE_ASSIGN_OR_RETURN(set.set, ParseEmva1288Data(text, set.description_file));
  if (set.set.name().empty()) {
    const fs::path folder = fs::absolute(set.folder).lexically_normal();
    // "set/" ends in an empty name.
    set.set.set_name((folder.has_filename() ? folder : folder.parent_path()).filename().string());
  }
  std::vector<ListedImage> listed;
  for (int i = 0; i < set.set.steps_size(); ++i) {
    for (const std::string& file : set.set.steps(i).files()) {
      if (!StaysInFolder(file)) {
        return absl::InvalidArgumentError(
            absl::StrCat(set.description_file, ": steps[", i, "]: image ", file,
                         " must be named by a path within the folder of this file"));
      }
      listed.push_back({file, absl::StrCat("steps[", i, "]")});
    }
  }
  SIGHTLINE_ASSIGN_OR_RETURN(set.images,
                             ReadListedImages(set.folder, listed, set.description_file));
  return set;
}

}  // namespace sightline
