// SPDX-License-Identifier: Apache-2.0
// Finds quantities for which a set is too small.
#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/recordings/check/recording_checks.h"

namespace sightline {

void RecordingChecks::CheckContents() {
  std::set<int> positions;
  std::set<double> exposures, f_numbers, distances;
  int lasers = 0, darks = 0, repeats = 0;
  std::set<std::pair<int, double>> taken;
  std::map<int, std::set<double>> sweep;
  for (const RecordedImage& image : set_.recordings) {
    if (image.kind == RecordingKind::kDark) {
      ++darks;
      continue;
    }
    if (image.kind != RecordingKind::kLaser) continue;
    ++lasers;
    const int position = image.plate_position_id.value_or(-1);
    positions.insert(position);
    f_numbers.insert(image.f_number);
    distances.insert(image.camera_distance_m);
    sweep[position].insert(image.exposure_time_s);
    if (!taken.insert({position, image.exposure_time_s}).second) ++repeats;
  }
  if (lasers == 0) {
    Error("recordings: none has kind \"laser\"; without a line there is nothing to compare", "",
          {});
    return;
  }
  const auto lack = [&](const std::string& what, const std::string& means) {
    Warning(absl::StrCat("recordings: ", what, "; ", means), "", {});
  };
  if (lasers < 6) {
    lack(absl::StrCat("only ", lasers, " of kind \"laser\""),
         "too few to say anything but gross differences");
  }
  if (darks == 0) {
    lack("none has kind \"dark\"", "dark level, dark current and other light cannot be separated");
  }
  if (positions.size() < 3) {
    lack(absl::StrCat("only ", positions.size(), " different plate_position_id"),
         "speckle does not average out, so brightness and line position stay uncertain");
  }
  if (repeats == 0) {
    lack("no two with the same plate_position_id and exposure_time_s",
         "temporal noise cannot be separated from speckle");
  }
  const bool swept =
      std::any_of(sweep.begin(), sweep.end(), [](const auto& s) { return s.second.size() >= 3; });
  if (!swept) {
    lack("no plate_position_id has three different exposure_time_s",
         "the sensor's response cannot be separated from the optics");
  }
  if (f_numbers.size() < 2) {
    lack("all have the same f_number",
         "aperture, aberrations and transmission cannot be separated "
         "from power and reflectance");
  }
  if (distances.size() < 2) {
    lack("all have the same camera_distance_m", "focus and distance errors stay hidden");
  }
}

}  // namespace sightline
