// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/recorded_folder.h"

#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/recordings/assumed_values.h"
#include "core/recordings/recordings.h"
#include "core/status/status_macros.h"
#include "planner_client/diagnosis_client/listed_images.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

}  // namespace

absl::StatusOr<RecordedFolder> ReadRecordedFolder(const std::string& path, Shown shown,
                                                  MissingValues missing_values) {
  RecordedFolder set;
  const fs::path description =
      fs::is_directory(path) ? fs::path(path) / "recordings.json" : fs::path(path);
  set.description_file = description.string();
  set.folder = description.has_parent_path() ? description.parent_path().string() : ".";
  SIGHTLINE_RETURN_IF_ERROR(ReadRecordingsMessage(set.description_file, &set.recordings));
  if (missing_values == MissingValues::kAssume) {
    set.assumptions = AssumeMissingValues(&set.recordings);
  }
  SIGHTLINE_RETURN_IF_ERROR(ParseRecordings(set.recordings, set.description_file).status());
  if (shown == Shown::kPlate && set.recordings.format_version() != 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        set.description_file, ": format_version is ", set.recordings.format_version(),
        set.recordings.format_version() == 2 ? " (images of a part)" : " (plates in poses)",
        ", must be 1: laser lines on a flat plate"));
  }
  std::vector<ListedImage> listed;
  for (const v1::Recording& recording : set.recordings.recordings()) {
    listed.push_back({recording.file(), ""});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      set.images, ReadListedImages(set.folder, listed,
                                   absl::StrCat(set.description_file, ": recordings[].file")));
  return set;
}

}  // namespace sightline
