// SPDX-License-Identifier: Apache-2.0
#include "report/recordings/recording_text.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "report/page/number_text.h"

namespace sightline {

std::string RecordingSetup(const v1::Recording& recording) {
  std::vector<std::string> words;
  if (recording.kind() == "dark" || recording.kind() == "ambient")
    words.push_back(recording.kind());
  // With a closed shutter the lens does not matter.
  const bool has_light = recording.kind() != "dark";
  if (has_light && recording.has_f_number()) {
    words.push_back(absl::StrCat("f/", ShortNumber(recording.f_number())));
  }
  if (recording.has_exposure_time_s()) {
    words.push_back(SettingText("exposure_time_s", recording.exposure_time_s()));
  }
  if (has_light && recording.has_camera_distance_m()) {
    words.push_back(
        absl::StrCat("camera ", SettingText("camera_distance_m", recording.camera_distance_m())));
  }
  // Parts: the distance is one of the measurement's.
  if (has_light && !recording.has_camera_distance_m() && recording.has_measurement()) {
    words.push_back(absl::StrCat(
        "camera ", SettingText("camera_distance_m", recording.measurement().camera_distance_m())));
  }
  if (has_light && recording.has_focus_distance_m()) {
    words.push_back(
        absl::StrCat("focus ", SettingText("focus_distance_m", recording.focus_distance_m())));
  }
  if (recording.has_scan()) {
    words.push_back(absl::StrCat("scan ", recording.scan(), ", frame ", recording.frame()));
  }
  return absl::StrJoin(words, ", ");
}

std::string RecordingTitle(int index, const v1::Recording* recording) {
  std::string title = absl::StrCat("Recording ", index);
  if (recording == nullptr || recording->series().empty()) return title;
  return absl::StrCat(title, " (", absl::StrReplaceAll(recording->series(), {{"_", " "}}), ")");
}

}  // namespace sightline
