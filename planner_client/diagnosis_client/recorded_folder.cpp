#include "planner_client/diagnosis_client/recorded_folder.h"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/recordings/recordings.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostNamed = 5;

}  // namespace

absl::StatusOr<RecordedFolder> ReadRecordedFolder(const std::string& path, Shown shown) {
  RecordedFolder set;
  const fs::path description =
      fs::is_directory(path) ? fs::path(path) / "recordings.json" : fs::path(path);
  set.description_file = description.string();
  set.folder = description.has_parent_path() ? description.parent_path().string() : ".";
  absl::Status status = ReadRecordingsMessage(set.description_file, &set.recordings);
  if (!status.ok()) return status;
  status = ParseRecordings(set.recordings, set.description_file).status();
  if (!status.ok()) return status;
  if (shown == Shown::kPlate && set.recordings.format_version() != 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(set.description_file, ": format_version is ", set.recordings.format_version(),
                     " (images of a part), must be 1: laser lines on a flat plate"));
  }
  std::vector<std::string> missing;
  for (const v1::Recording& recording : set.recordings.recordings()) {
    const fs::path file = fs::path(set.folder) / recording.file();
    std::ifstream stream(file, std::ios::binary);
    std::ostringstream bytes;
    if (stream) bytes << stream.rdbuf();
    if (!stream || !fs::is_regular_file(file)) {
      missing.push_back(recording.file());
      continue;
    }
    set.images.push_back({recording.file(), std::move(bytes).str()});
    if (set.images.back().bytes.empty()) {
      return absl::InvalidArgumentError(absl::StrCat(file.string(), ": is empty"));
    }
  }
  if (missing.empty()) return set;
  std::string names;
  for (size_t i = 0; i < missing.size() && i < kMostNamed; ++i) {
    absl::StrAppend(&names, i > 0 ? ", " : "", missing[i]);
  }
  if (missing.size() > kMostNamed) {
    absl::StrAppend(&names, " and ", missing.size() - kMostNamed, " more");
  }
  return absl::NotFoundError(
      absl::StrCat(set.description_file, ": recordings[].file: ", missing.size(), " of ",
                   set.recordings.recordings_size(), " images cannot be read: ", names));
}

}  // namespace sightline
