// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/optics/optics_outputs.h"

#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"

namespace sightline {

namespace {

void ClearPictures(v1::OpticsChoice* choice) {
  for (v1::RepresentativeFrame& frame : *choice->mutable_frames()) frame.clear_picture_png();
  if (choice->has_check()) choice->mutable_check()->clear_picture_png();
}

}  // namespace

absl::Status WriteOpticsJson(const v1::OpticsPlan& optics, const std::string& path) {
  v1::OpticsPlan numbers = optics;
  ClearPictures(numbers.mutable_common());
  for (v1::OpticsChoice& scan : *numbers.mutable_scans()) ClearPictures(&scan);
  return WriteFileAtomically(path, ToJson(numbers) + "\n");
}

void SetSettings(const v1::OpticsPlan& optics, v1::Plan* plan) {
  for (v1::PlannedScan& scan : *plan->mutable_scans()) {
    *scan.mutable_setting() = optics.best().setting();
  }
  for (const v1::OpticsChoice& choice : optics.scans()) {
    const int index = choice.scan() - 1;
    if (index < 0 || index >= plan->scans_size()) continue;
    *plan->mutable_scans(index)->mutable_setting() = choice.best().setting();
  }
}

}  // namespace sightline
