// SPDX-License-Identifier: Apache-2.0
// Whether the numbers are raw: bits, stretched or compressed values, copies.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/image/image.h"
#include "core/recordings/check/check_recordings.h"
#include "core/recordings/check/recording_checks.h"
#include "core/recordings/raw_numbers.h"

namespace sightline {

void RecordingChecks::CollectNumbers() {
  all_ = Histogram(65536);
  largest_seen_ = 0;
  for (int i = 0; i < count_; ++i) {
    if (!Has(i)) continue;
    const Histogram counts = CountValues(raw_[i]);
    RecordingState& state = result_.recordings[i];
    double sum = 0;
    int64_t saturated = 0;
    for (int value = 0; value < 65536; ++value) {
      if (counts[value] == 0) continue;
      all_[value] += counts[value];
      sum += static_cast<double>(counts[value]) * value;
      state.largest_dn = value;
      if (value >= Largest()) saturated += counts[value];
    }
    const double pixels = static_cast<double>(raw_[i].values.size());
    state.mean_dn = sum / pixels;
    state.saturated_fraction = static_cast<double>(saturated) / pixels;
    largest_seen_ = std::max(largest_seen_, static_cast<int>(state.largest_dn));
  }
}

void RecordingChecks::CheckNumbers() {
  const int bits = set_.camera.bit_depth_bit;
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || result_.recordings[i].largest_dn <= Largest()) continue;
    const int step = CommonPowerOfTwo(CountValues(raw_[i]));
    std::string reason = absl::StrCat("has values above 2^camera.bit_depth_bit - 1 = ", Largest());
    if (step > 1) {
      absl::StrAppend(&reason, ", all of them multiples of ", step,
                      ": the numbers are left-justified in 16 bits; store them as read out");
    } else {
      absl::StrAppend(&reason,
                      ": the numbers are scaled, or the camera has more bits than is said");
    }
    Error(reason, absl::StrCat("values above ", Largest()), {i});
    out_of_range_ = true;
  }
  if (out_of_range_ || bits <= 8 || largest_seen_ == 0) return;

  // 8-bit data in a wider file: clipped at 255.
  for (int narrow = 8; narrow < bits; ++narrow) {
    const int top = (1 << narrow) - 1;
    if (largest_seen_ != top) continue;
    int64_t next = 0;
    for (int value = top - 4; value < top; ++value) next += all_[value];
    if (all_[top] < 20 || all_[top] < 2 * next) continue;
    std::vector<int> files;
    for (int i = 0; i < count_; ++i) {
      if (Has(i) && result_.recordings[i].largest_dn == top) files.push_back(i);
    }
    Error(absl::StrCat("is clipped at ", top, ": ", narrow,
                       "-bit data, but camera.bit_depth_bit is ", bits, "; record raw numbers"),
          absl::StrCat(narrow, "-bit data"), files);
    result_.narrow = {narrow, 0, std::pow(2.0, narrow - bits)};
    narrow_ = true;
    return;
  }
  for (int narrow = 8; narrow < bits; ++narrow) {
    if (!IsBitReplicated(all_, narrow, bits)) continue;
    Error(absl::StrCat("camera.bit_depth_bit is ", bits, ", but all images hold only the ",
                       1 << narrow, " values of ", narrow,
                       "-bit data stretched to it: record raw numbers"),
          "", {});
    result_.narrow = {narrow, bits - narrow, std::pow(2.0, narrow - bits)};
    narrow_ = true;
    return;
  }
  const int step = CommonPowerOfTwo(all_);
  if (step > 1) {
    Warning(absl::StrCat("all values are multiples of ", step,
                         ": the lowest bits of the converter are stuck, or the images were made "
                         "from data of fewer bits than camera.bit_depth_bit = ",
                         bits),
            "", {});
    return;
  }
  constexpr double kComb = 0.4;
  if (const double missing = MissingValueShare(all_, UpperLimit(all_, Largest()));
      missing > kComb) {
    Error(absl::StrFormat("camera.bit_depth_bit is %d, but %.0f %% of the values in between never "
                          "occur: the images were stretched from fewer values (8-bit data such "
                          "as JPEG, a contrast curve); record raw numbers",
                          bits, 100 * missing),
          "", {});
    narrow_ = true;
    return;
  }
  // Some images only.
  for (int i = 0; i < count_; ++i) {
    if (!Has(i)) continue;
    const Histogram counts = CountValues(raw_[i]);
    if (MissingValueShare(counts, UpperLimit(counts, Largest())) <= kComb) continue;
    Error(
        "most of the values in between never occur, unlike in the other images: stretched from "
        "fewer values (8-bit data such as JPEG, a contrast curve); record raw numbers",
        "stretched numbers", {i});
  }
}

void RecordingChecks::CheckBlankAndClipped() {
  for (int i = 0; i < count_; ++i) {
    if (!Has(i)) continue;
    const RecordingState& state = result_.recordings[i];
    const Histogram counts = CountValues(raw_[i]);
    const bool blank = counts[static_cast<size_t>(state.largest_dn)] ==
                       static_cast<int64_t>(raw_[i].values.size());
    // A quiet sensor's dark frame may well be nothing but zeros.
    if (blank &&
        !(IsDark(i) && state.largest_dn == 0 && NominalDark() < 0.2 && NominalDarkNoise() < 0.4)) {
      blank_.insert(i);
      Error(absl::StrCat("is blank: all pixels are ", state.largest_dn,
                         IsDark(i) ? ", though camera.dark_noise_electrons makes them vary" : "",
                         "; record it again"),
            "blank", {i});
    } else if (state.saturated_fraction > 0.5) {
      blank_.insert(i);
      Error("most pixels are saturated: record it again with a shorter exposure_time_s",
            "saturated", {i});
    }
  }
}

void RecordingChecks::CheckDuplicates() {
  std::map<std::vector<uint16_t>, int> first;
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || blank_.count(i) > 0) continue;
    const RecordingState& state = result_.recordings[i];
    // Two dark frames of a quiet sensor with few values can be equal by chance.
    if (CountValues(raw_[i])[static_cast<size_t>(std::lround(state.mean_dn))] >
        static_cast<int64_t>(raw_[i].values.size()) * 99 / 100) {
      continue;
    }
    const auto [place, is_new] = first.emplace(raw_[i].values, i);
    if (is_new) continue;
    Error(absl::StrCat("has the same pixels as ", File(place->second),
                       ": noise never repeats, one of the two is a copy; record it again"),
          absl::StrCat("copy of ", File(place->second)), {i});
  }
}

void RecordingChecks::CheckBlocks() {
  std::vector<const Image<uint16_t>*> all;
  for (int i = 0; i < count_; ++i) {
    if (Has(i) && blank_.count(i) == 0) all.push_back(&raw_[i]);
  }
  const std::string reason =
      "steps every eight columns: the image was JPEG-compressed, which has changed its numbers; "
      "record raw numbers";
  const BlockEdges together = FindBlockEdges(all);
  const bool together_found = together.score > 8 && together.ratio > 1.06;
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || blank_.count(i) > 0) continue;
    const BlockEdges own = FindBlockEdges({&raw_[i]});
    const bool own_found = own.score > 8 && own.ratio > 1.12;
    if (own_found || (together_found && own.score > 5 && own.phase == together.phase)) {
      Error(reason, "JPEG blocks", {i});
    }
  }
}

}  // namespace sightline
