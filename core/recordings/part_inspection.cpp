// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/part_inspection.h"

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace sightline {

absl::StatusOr<v1::Inspection> InspectionOfRecordings(const v1::Recordings& recordings,
                                                      const std::string& context) {
  if (recordings.format_version() != 2 || !recordings.has_part()) {
    return absl::InvalidArgumentError(absl::StrCat(context, ": format_version is ",
                                                   recordings.format_version(),
                                                   ", must be 2: recordings of a part"));
  }
  if (recordings.recordings().empty()) {
    return absl::InvalidArgumentError(absl::StrCat(context, ": recordings is empty"));
  }
  const v1::Recording& first = recordings.recordings(0);
  for (int i = 0; i < recordings.recordings_size(); ++i) {
    const v1::Recording& recording = recordings.recordings(i);
    const std::string path = absl::StrCat(context, ": recordings[", i, "]");
    if (recording.roi_columns_px() != first.roi_columns_px() ||
        recording.roi_rows_px() != first.roi_rows_px()) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, " has a region of ", recording.roi_columns_px(), " x ",
                       recording.roi_rows_px(), " px, must be that of recordings[0], ",
                       first.roi_columns_px(), " x ", first.roi_rows_px()));
    }
    if (recording.roi_column_px() != -(recording.roi_columns_px() / 2) ||
        recording.roi_row_px() != -(recording.roi_rows_px() / 2)) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ".roi_column_px, roi_row_px are ", recording.roi_column_px(), ", ",
                       recording.roi_row_px(), ", must be ", -(recording.roi_columns_px() / 2),
                       ", ", -(recording.roi_rows_px() / 2), ": the middle of the sensor"));
    }
  }
  v1::Inspection inspection;
  inspection.set_name(recordings.set());
  inspection.mutable_part()->set_file(recordings.part().file());
  *inspection.mutable_camera()->mutable_sensor() = recordings.camera();
  inspection.mutable_camera()->set_columns_px(first.roi_columns_px());
  inspection.mutable_camera()->set_rows_px(first.roi_rows_px());
  // The region is a part of the sensor's image, not the image at another scale.
  inspection.mutable_camera()->mutable_sensor()->set_sensor_columns_px(first.roi_columns_px());
  inspection.mutable_camera()->mutable_sensor()->set_sensor_rows_px(first.roi_rows_px());
  *inspection.mutable_lens() = recordings.part().lens();
  *inspection.mutable_laser() = recordings.part().laser();
  *inspection.mutable_materials() = recordings.part().materials();
  *inspection.mutable_lighting() = recordings.part().lighting();
  inspection.mutable_render()->set_laser_interreflection(false);
  inspection.mutable_render()->set_exposure_time_s(first.exposure_time_s());
  return inspection;
}

}  // namespace sightline
