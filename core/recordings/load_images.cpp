// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/load_images.h"

#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/image/image_tags.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Raw numbers of a set that are held at once.
constexpr int64_t kMaxSetBytes = int64_t{16} << 30;

}  // namespace

absl::StatusOr<Image<uint16_t>> LoadRawImage(const std::string& path, int bit_depth_bit,
                                             const ImageSizeCheck& check_size,
                                             const StopCheck& stop) {
  SIGHTLINE_ASSIGN_OR_RETURN(RawImageFile file, ReadRawImageFile(path, check_size, stop));
  if (file.file_bits == 8 && bit_depth_bit > 8) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": has 8 bits a pixel, but the camera has ", bit_depth_bit,
                     ": record raw numbers in 16-bit files"));
  }
  return std::move(file.raw_dn);
}

absl::StatusOr<LoadedImages> LoadRecordedImages(const RecordingSet& set,
                                                const std::vector<std::string>& paths,
                                                const StopCheck& stop) {
  int64_t bytes = 0;
  for (const RecordedImage& recording : set.recordings) {
    bytes += int64_t{recording.roi_columns_px} * recording.roi_rows_px *
             static_cast<int64_t>(sizeof(uint16_t));
    if (bytes <= kMaxSetBytes) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "recordings: their regions of interest (roi_columns_px, roi_rows_px) have more than the ",
        kMaxSetBytes >> 30, " GiB of raw numbers that can be read at once; divide the set"));
  }
  LoadedImages loaded;
  std::vector<Image<uint16_t>>& images = loaded.raw_dn;
  std::vector<std::string>* const errors = &loaded.errors;
  images.resize(set.recordings.size());
  std::vector<std::string> narrow;
  std::map<int, std::vector<std::string>> by_orientation;
  for (size_t i = 0; i < images.size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
    const RecordedImage& recording = set.recordings[i];
    if (i >= paths.size()) {
      errors->push_back(absl::StrCat(recording.file, ": recordings[", i, "].file is missing"));
      continue;
    }
    std::string wrong_size;
    const auto check_size = [&](int columns_px, int rows_px) {
      if (columns_px == recording.roi_columns_px && rows_px == recording.roi_rows_px) {
        return absl::OkStatus();
      }
      wrong_size = absl::StrCat(recording.file, ": is ", columns_px, " x ", rows_px,
                                " px, but recordings[", i, "].roi_columns_px and roi_rows_px are ",
                                recording.roi_columns_px, " and ", recording.roi_rows_px,
                                ": wrong region of interest, or another image");
      return absl::InvalidArgumentError(wrong_size);
    };
    absl::StatusOr<RawImageFile> file = ReadRawImageFile(paths[i], check_size, stop);
    if (file.ok()) {
      if (file->file_bits == 8 && set.camera.bit_depth_bit > 8) narrow.push_back(recording.file);
      if (file->orientation != 1) by_orientation[file->orientation].push_back(recording.file);
      images[i] = std::move(file->raw_dn);
    } else if (absl::IsNotFound(file.status())) {
      errors->push_back(absl::StrCat(recording.file, ": recordings[", i,
                                     "].file is missing: ", file.status().message()));
    } else if (!absl::IsInvalidArgument(file.status())) {
      return file.status();
    } else if (!wrong_size.empty()) {
      errors->push_back(wrong_size);
    } else {
      errors->push_back(absl::StrCat("recordings[", i, "].file: ", file.status().message()));
    }
  }
  for (const auto& [orientation, files] : by_orientation) {
    loaded.remarks.push_back(absl::StrCat(
        files.front(), files.size() > 1 ? absl::StrCat(" and ", files.size() - 1, " more") : "",
        ": the orientation that the file states is obeyed (", orientation, ", ",
        OrientationText(orientation), ")"));
  }
  // All files of one camera have the same width of numbers.
  if (!narrow.empty() && narrow.size() == images.size()) {
    loaded.eight_bit_files = true;
  } else if (!narrow.empty()) {
    errors->push_back(absl::StrCat(
        narrow.front(), ": has 8 bits a pixel, but others have 16",
        narrow.size() > 1 ? absl::StrCat(" (like ", narrow.size() - 1, " more)") : std::string(),
        ": record raw numbers of camera.bit_depth_bit = ", set.camera.bit_depth_bit));
  }
  return loaded;
}

}  // namespace sightline
