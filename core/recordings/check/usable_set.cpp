// SPDX-License-Identifier: Apache-2.0
// Selects the usable recordings of a set with errors.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/image/image.h"
#include "core/recordings/check/check_recordings.h"
#include "core/recordings/recordings.h"

namespace sightline {

NarrowNumbers EightBitNumbers(const Sensor& camera) {
  return {8, 0, std::pow(2.0, 8 - camera.bit_depth_bit)};
}

std::string TakeNarrowNumbers(const NarrowNumbers& narrow, RecordingSet* set,
                              std::vector<Image<uint16_t>>* raw_dn) {
  Sensor& camera = set->camera;
  std::string warning = absl::StrFormat(
      "camera.bit_depth_bit is %d, but all images hold %d-bit numbers: they are taken as such, "
      "gain "
      "and black level %s; their rounding hides changes below one step",
      camera.bit_depth_bit, narrow.bit_depth_bit,
      narrow.gain_factor == 1 ? "as described" : absl::StrFormat("times %.4g", narrow.gain_factor));
  camera.bit_depth_bit = narrow.bit_depth_bit;
  camera.gain_dn_per_electron *= narrow.gain_factor;
  camera.black_level_dn *= narrow.gain_factor;
  for (Image<uint16_t>& image : *raw_dn) {
    for (uint16_t& value : image.values) value >>= narrow.repeated_bit;
  }
  return warning;
}

std::vector<std::string> LeaveOutWithoutLine(const RecordingCheck& check, RecordingSet* set,
                                             std::vector<Image<uint16_t>>* raw_dn) {
  constexpr size_t kMostShare = 10;  // one in
  std::vector<RecordedImage>& recordings = set->recordings;
  const auto lasers =
      static_cast<size_t>(std::count_if(recordings.begin(), recordings.end(), [](const auto& r) {
        return r.kind == RecordingKind::kLaser;
      }));
  if (check.without_line.size() * kMostShare > lasers) return {};
  for (const int i : check.without_line) {
    const bool followed =
        i + 1 < static_cast<int>(recordings.size()) && recordings[i + 1].burst_frame_index > 0;
    if (recordings[i].burst_frame_index > 0 || followed) return {};
  }
  std::vector<std::string> left_out;
  for (auto i = check.without_line.rbegin(); i != check.without_line.rend(); ++i) {
    left_out.insert(left_out.begin(),
                    absl::StrCat(recordings[*i].file,
                                 ": kind is \"laser\", but there is no line; it was left out"));
    recordings.erase(recordings.begin() + *i);
    raw_dn->erase(raw_dn->begin() + *i);
  }
  return left_out;
}

}  // namespace sightline
