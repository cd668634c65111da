// SPDX-License-Identifier: Apache-2.0
// Whether the line is there, as bright as described and where it should be, with its speckle.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/image/image.h"
#include "core/recordings/check/recording_checks.h"
#include "core/recordings/expected_line.h"

namespace sightline {
namespace {

// First row and column and step of one channel's pixels.
struct Pixels {
  int row = 0, column = 0, step = 1;
};

Pixels BrightestPixels(const Sensor& sensor, double wavelength_m) {
  if (sensor.colour_filter == ColourFilter::kMono) return {};
  int best = 0;
  for (int c = 1; c < 3; ++c) {
    if (sensor.quantum_efficiency[c].At(wavelength_m) >
        sensor.quantum_efficiency[best].At(wavelength_m)) {
      best = c;
    }
  }
  return best == kRed ? Pixels{0, 0, 2} : best == kBlue ? Pixels{1, 1, 2} : Pixels{0, 1, 2};
}

SeenLine FindLine(const Image<uint16_t>& image, const Pixels& pixels, double width_px) {
  std::vector<double> rows;
  for (int row = pixels.row; row < image.rows_px; row += pixels.step) {
    double sum = 0;
    int count = 0;
    for (int column = pixels.column; column < image.columns_px; column += pixels.step) {
      sum += image.At(row, column);
      ++count;
    }
    rows.push_back(sum / std::max(1, count));
  }
  SeenLine line;
  const int size = static_cast<int>(rows.size());
  const int half = std::max(1, static_cast<int>(std::lround(width_px / pixels.step)));
  if (size < 8 * half) return line;
  const double background = MedianOf(rows);
  int peak = 0;
  double highest = -1e300;
  for (int row = 0; row < size; ++row) {
    double sum = 0;
    for (int k = -half; k <= half; ++k) sum += rows[std::clamp(row + k, 0, size - 1)] - background;
    if (sum > highest) {
      highest = sum;
      peak = row;
    }
  }
  const int reach = 4 * half + 8 / pixels.step;
  double energy = 0, moment = 0;
  int inside = 0;
  std::vector<double> steps;
  for (int row = 0; row < size; ++row) {
    if (std::abs(row - peak) <= reach) {
      const double value = rows[row] - background;
      energy += value;
      moment += value * row;
      ++inside;
    } else if (row > 0 && std::abs(row - 1 - peak) > reach) {
      steps.push_back(std::abs(rows[row] - rows[row - 1]));
    }
  }
  // Median of |difference of two| is 0.954 standard deviations; half the rounding step at least.
  const double row_error = std::max(MedianOf(steps) / 0.954, 0.02);
  line.energy_dn = energy * pixels.step;
  line.energy_error_dn = row_error * std::sqrt(static_cast<double>(inside)) * pixels.step;
  line.row_px = energy > 0 ? pixels.row + pixels.step * moment / energy : 0;
  line.found = energy * pixels.step > 8 * line.energy_error_dn &&
               highest / (2 * half + 1) > 5 * row_error / std::sqrt(2.0 * half + 1);
  return line;
}

// Correlation of two recordings' pixels in the rows of the line, relative to their rows' means.
std::optional<double> PatternCorrelation(const Image<uint16_t>& a, const Image<uint16_t>& b,
                                         double dark_dn) {
  double ab = 0, aa = 0, bb = 0;
  for (int row = 0; row < a.rows_px; ++row) {
    const uint16_t* va = a.Row(row);
    const uint16_t* vb = b.Row(row);
    // Alternate columns may have other colours.
    for (int parity = 0; parity < 2; ++parity) {
      double mean_a = 0, mean_b = 0, count = 0;
      for (int j = parity; j < a.columns_px; j += 2) {
        mean_a += va[j];
        mean_b += vb[j];
        ++count;
      }
      mean_a /= count;
      mean_b /= count;
      if (mean_a < 2 * dark_dn + 30 || mean_b < 2 * dark_dn + 30) continue;
      for (int j = parity; j < a.columns_px; j += 2) {
        ab += (va[j] - mean_a) * (vb[j] - mean_b);
        aa += (va[j] - mean_a) * (va[j] - mean_a);
        bb += (vb[j] - mean_b) * (vb[j] - mean_b);
      }
    }
  }
  if (!(aa > 0 && bb > 0)) return std::nullopt;
  return ab / std::sqrt(aa * bb);
}

bool SameOptics(const RecordedImage& a, const RecordedImage& b) {
  return a.f_number == b.f_number && a.camera_distance_m == b.camera_distance_m &&
         a.focus_distance_m == b.focus_distance_m && a.laser_distance_m == b.laser_distance_m &&
         a.line_offset_m == b.line_offset_m && a.roi_column_px == b.roi_column_px &&
         a.roi_row_px == b.roi_row_px && a.roi_columns_px == b.roi_columns_px &&
         a.roi_rows_px == b.roi_rows_px;
}

}  // namespace

void RecordingChecks::FindLines() {
  const Pixels pixels = BrightestPixels(set_.camera, set_.laser.wavelength_m);
  for (int i = 0; i < count_; ++i) {
    expected_.push_back(ExpectLine(set_, set_.recordings[i]));
    lines_.push_back(Has(i) && blank_.count(i) == 0
                         ? FindLine(raw_[i], pixels, expected_[i].width_px)
                         : SeenLine{});
    result_.recordings[i].line_found = lines_[i].found;
  }
}

double RecordingChecks::ExpectedEnergyDn(int i) const {
  const auto& electrons = expected_[i].electrons_per_column;
  return set_.camera.gain_dn_per_electron * *std::max_element(electrons.begin(), electrons.end());
}

void RecordingChecks::CheckLight() {
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || blank_.count(i) > 0) continue;
    const SeenLine& line = lines_[i];
    if (IsLaser(i) && !line.found && ExpectedEnergyDn(i) > 30 * line.energy_error_dn) {
      Error(
          "kind is \"laser\", but there is no line: the laser was off, the shutter closed, or "
          "the line outside the region of interest; record it again",
          "no line", {i});
      no_line_.insert(i);
      result_.without_line.push_back(i);
    }
    if (!IsDark(i) || !line.found) continue;
    // A trace of the frame before is the sensor's (image lag), not a mistake.
    const bool burst = set_.recordings[i].burst_frame_index > 0 && i > 0;
    const double trace = burst ? 0.5 * lines_[i - 1].energy_dn : 0;
    if (line.energy_dn > std::max(trace, 0.2 * ExpectedEnergyDn(i))) {
      Error("kind is \"dark\", but the laser line shows: close the shutter and record it again",
            "line in a dark frame", {i});
    }
  }
}

void RecordingChecks::CheckBrightness() {
  std::vector<double> ratio(static_cast<size_t>(count_), 0), known;
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || !IsLaser(i) || !lines_[i].found) continue;
    if (lines_[i].energy_dn < 20 * lines_[i].energy_error_dn) continue;
    // Clipped light cannot be compared.
    if (result_.recordings[i].saturated_fraction > 0.001) continue;
    if (ExpectedEnergyDn(i) <= 0) continue;
    ratio[i] = lines_[i].energy_dn / ExpectedEnergyDn(i);
    known.push_back(ratio[i]);
  }
  if (known.empty()) return;
  median_ratio_ = MedianOf(known);
  const int bits = set_.camera.bit_depth_bit;
  // Lower bits clipped above rather than upper bits: the light is as bright as described.
  if (result_.narrow && result_.narrow->repeated_bit == 0 &&
      std::abs(std::log(median_ratio_)) <
          std::abs(std::log(median_ratio_ / result_.narrow->gain_factor))) {
    result_.narrow->gain_factor = 1;
  }
  // 8-bit data that is clipped nowhere: light and dark level both too small by the same factor.
  for (int narrow = 8; narrow < bits && !narrow_ && !out_of_range_; ++narrow) {
    const double factor = std::pow(2.0, narrow - bits);
    const double dark = DarkLevel();
    if (largest_seen_ >= (1 << narrow) || NominalDark() < 2) continue;
    if (std::abs(std::log(median_ratio_ / factor)) > 0.35) continue;
    if (std::abs(dark - factor * NominalDark()) > 0.3 * factor * NominalDark() + 0.3) continue;
    Error(absl::StrFormat("light and dark level are both %.2g times what camera describes, and "
                          "no value is above %d: %d-bit data, but camera.bit_depth_bit is %d; "
                          "record raw numbers",
                          median_ratio_, (1 << narrow) - 1, narrow, bits),
          "", {});
    result_.narrow = {narrow, 0, factor};
    narrow_ = true;
  }
  if (narrow_ || out_of_range_) return;
  if (median_ratio_ > 4 || median_ratio_ < 0.25) {
    Warning(absl::StrFormat("the line is %.2g times as bright as described: laser.power_w, "
                            "surface, lens.transmission or camera.gain_dn_per_electron are "
                            "probably wrong",
                            median_ratio_),
            "", {});
  }
  if (known.size() < 3) return;
  for (int i = 0; i < count_; ++i) {
    if (ratio[i] == 0) continue;
    const double relative = ratio[i] / median_ratio_;
    if (relative < 2.5 && relative > 0.4) continue;
    Warning(absl::StrFormat("is %.2g times as bright as its exposure_time_s, f_number and "
                            "distances say, compared with the others: were they set and written "
                            "down right?",
                            relative),
            absl::StrFormat("%.2g times too bright", relative), {i});
  }
}

void RecordingChecks::CheckPlace() {
  // Known within the stated uncertainties; else to some pixels.
  const double sigma_px = std::hypot(std::max(1.0, set_.uncertainty.line_position_common_px),
                                     std::max(0.5, set_.uncertainty.line_position_each_px));
  std::vector<double> offsets;
  std::vector<int> seen;
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || !IsLaser(i) || !lines_[i].found) continue;
    offsets.push_back(lines_[i].row_px - expected_[i].row_px);
    seen.push_back(i);
  }
  if (offsets.empty()) return;
  const double common = MedianOf(offsets);
  const auto allowed = [&](int i) {
    // A wrong camera distance moves a line that is off the axis.
    const double off_axis = std::abs(expected_[i].row_px + set_.recordings[i].roi_row_px);
    return 20 + 10 * sigma_px + 0.05 * off_axis + expected_[i].width_px;
  };
  for (size_t k = 0; k < seen.size(); ++k) {
    const int i = seen[k];
    const double offset = offsets[k] - (offsets.size() >= 3 ? common : 0);
    if (std::abs(offset) <= allowed(i)) continue;
    Error(
        "the line is not where line_offset_m and roi_row_px put it (the others are): wrong "
        "region of interest; read it out again or correct the numbers",
        absl::StrFormat("line %.0f px off", offset), {i});
  }
  if (offsets.size() >= 3 && std::abs(common) > 20 + 10 * sigma_px) {
    Warning(absl::StrFormat("the line is some %.0f px from where line_offset_m and roi_row_px put "
                            "it: wrong region of interest, or the rig is not aligned",
                            common),
            "", {});
  }
}

void RecordingChecks::CheckSpeckle() {
  const double dark = DarkLevel();
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || !IsLaser(i) || !lines_[i].found || no_line_.count(i) > 0) continue;
    for (int j = i + 1; j < count_ && j < i + 12; ++j) {
      if (!Has(j) || !IsLaser(j) || !lines_[j].found) continue;
      const RecordedImage& a = set_.recordings[i];
      const RecordedImage& b = set_.recordings[j];
      if (!SameOptics(a, b) || a.exposure_time_s != b.exposure_time_s) continue;
      const auto correlation = PatternCorrelation(raw_[i], raw_[j], dark);
      if (!correlation) continue;
      const bool same = a.plate_position_id == b.plate_position_id;
      if (same && *correlation < 0.3 && lines_[i].energy_dn > 100 * lines_[i].energy_error_dn) {
        Warning(absl::StrCat("has another speckle pattern than ", File(i),
                             " with the same plate_position_id: the plate was moved in between, "
                             "or the files are mixed up"),
                "speckle differs", {j});
      } else if (!same && *correlation > 0.8) {
        Warning(absl::StrCat("has the speckle pattern of ", File(i),
                             " under another plate_position_id: the plate was not moved"),
                "speckle repeats", {j});
      }
    }
  }
}

}  // namespace sightline
