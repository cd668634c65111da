// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/check_scene.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "render_worker/render/part_frame.h"

namespace sightline {
namespace {

// Smallest focus distance over the focal length: a focus nearer than that needs an image distance
// of more than a hundred focal lengths.
constexpr double kNearestFocus = 1.01;

absl::Status CheckRecordedImage(const RecordedScene& scene, const RecordedImage& recorded,
                                const Image<uint16_t>& raw) {
  const Camera& camera = scene.inspection.rig.camera;
  if (raw.columns_px != camera.columns_px || raw.rows_px != camera.rows_px) {
    return absl::InvalidArgumentError(absl::StrCat(recorded.file, ": is ", raw.columns_px, " x ",
                                                   raw.rows_px, " px, must be ", camera.columns_px,
                                                   " x ", camera.rows_px));
  }
  const uint16_t largest = *std::max_element(raw.values.begin(), raw.values.end());
  if (largest > scene.inspection.sensor->largest_dn()) {
    return absl::InvalidArgumentError(absl::StrCat(recorded.file, ": has a raw number of ", largest,
                                                   ", the sensor's largest is ",
                                                   scene.inspection.sensor->largest_dn()));
  }
  const FrameSetup frame =
      PartFrameSetup(scene.inspection, {recorded.measurement, recorded.stage_position_m});
  if (*frame.lens.focus_distance_m <= kNearestFocus * frame.lens.focal_length_m) {
    return absl::InvalidArgumentError(
        absl::StrCat(recorded.file, ": is focused at ", *frame.lens.focus_distance_m,
                     " m, too near for a focal length of ", frame.lens.focal_length_m, " m"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckRecordedScene(const RecordedScene& scene) {
  if (scene.recordings.format_version != 2) {
    return absl::InvalidArgumentError(absl::StrCat("recordings: format_version is ",
                                                   scene.recordings.format_version,
                                                   ", must be 2: recordings of a part"));
  }
  if (!scene.inspection.sensor || !scene.inspection.rig.lens) {
    return absl::InvalidArgumentError("inspection: sensor and lens are needed");
  }
  const auto& recordings = scene.recordings.recordings;
  if (scene.raw_dn.size() != recordings.size()) {
    return absl::InvalidArgumentError(absl::StrCat("images: there are ", scene.raw_dn.size(),
                                                   ", must be one for each of the ",
                                                   recordings.size(), " recordings"));
  }
  bool laser = false;
  for (size_t i = 0; i < recordings.size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(CheckRecordedImage(scene, recordings[i], scene.raw_dn[i]));
    laser = laser || recordings[i].kind == RecordingKind::kLaser;
  }
  if (!laser) {
    return absl::FailedPreconditionError(
        "recordings: none has kind \"laser\"; light paths cannot be told apart without");
  }
  return absl::OkStatus();
}

}  // namespace sightline
