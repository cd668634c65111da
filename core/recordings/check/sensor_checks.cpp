// SPDX-License-Identifier: Apache-2.0
// Whether it is the camera that is described: colours, dark level, response.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/image/image.h"
#include "core/recordings/check/recording_checks.h"
#include "core/recordings/linearity.h"
#include "core/recordings/raw_numbers.h"
#include "core/statistics/order_statistics.h"

namespace sightline {
namespace {

// Signal of the pixels of even over that of odd columns, in even and in odd rows; 1 on mono
// sensors.
struct ColumnRatios {
  double even_rows = 1, odd_rows = 1;
};

std::optional<ColumnRatios> MeasureColumnRatios(const Image<uint16_t>& image, double dark_dn) {
  // Only rows outside the line are used: other light may have other colours. Half of the rows at
  // least are beside it.
  std::vector<double> means(static_cast<size_t>(image.rows_px));
  for (int row = 0; row < image.rows_px; ++row) {
    const uint16_t* values = image.Row(row);
    means[static_cast<size_t>(row)] =
        std::accumulate(values, values + image.columns_px, 0.0) / image.columns_px;
  }
  const double median_dn = UpperMedian(means);
  const double beside_dn = std::max(dark_dn, median_dn);
  std::array<std::array<double, 2>, 2> sums{}, background{};
  std::array<double, 2> rows{}, background_rows{};
  for (int row = 0; row < image.rows_px; ++row) {
    const uint16_t* values = image.Row(row);
    const bool on_line = means[static_cast<size_t>(row)] - beside_dn >= 0.25 * dark_dn + 10;
    const bool beside = means[static_cast<size_t>(row)] <= median_dn;
    if (!on_line && !beside) continue;
    (on_line ? rows : background_rows)[row % 2] += 1;
    for (int column = 0; column < image.columns_px; ++column) {
      (on_line ? sums : background)[row % 2][column % 2] += values[column];
    }
  }
  for (const int r : {0, 1}) {
    for (const int c : {0, 1}) {
      const int columns = (image.columns_px + 1 - c) / 2;
      const double level_dn =
          background_rows[r] > 0 ? background[r][c] / background_rows[r] : dark_dn * columns;
      sums[r][c] -= rows[r] * level_dn;
    }
  }
  // Faint channels may come out at nothing.
  const auto ratio = [&](int parity) {
    const double least = std::max(1.0, 0.01 * (sums[parity][0] + sums[parity][1]));
    return std::max(sums[parity][0], least) / std::max(sums[parity][1], least);
  };
  if (rows[0] < 1 || rows[1] < 1) return std::nullopt;
  return ColumnRatios{ratio(0), ratio(1)};
}

}  // namespace

int RecordingChecks::MedianValue(int i) const {
  const Histogram counts = CountValues(raw_[i]);
  int64_t below = 0;
  int value = 0;
  while (2 * (below += counts[value]) < static_cast<int64_t>(raw_[i].values.size())) ++value;
  return value;
}

double RecordingChecks::DarkLevel() const {
  std::vector<double> dark, other;
  for (int i = 0; i < count_; ++i) {
    if (!Has(i)) continue;
    if (IsDark(i)) {
      dark.push_back(result_.recordings[i].mean_dn);
    } else {
      other.push_back(MedianValue(i));
    }
  }
  return dark.empty() ? MedianOf(other) : MedianOf(dark);
}

void RecordingChecks::CheckColours() {
  const Sensor& sensor = set_.camera;
  const bool bayer = sensor.colour_filter == ColourFilter::kBayerRggb;
  const double dark = DarkLevel();
  double expected_even = 1, expected_odd = 1;
  if (bayer) {
    const auto efficiency = [&](int c) {
      return std::max(1e-3, sensor.quantum_efficiency[c].At(set_.laser.wavelength_m));
    };
    expected_even = efficiency(kRed) / efficiency(kGreen);
    expected_odd = efficiency(kGreen) / efficiency(kBlue);
  }
  std::vector<int> flat;  // recordings without the pattern
  size_t compared = 0;
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || !IsLaser(i) || !lines_[i].found) continue;
    if (result_.recordings[i].saturated_fraction > 0.002) continue;
    const auto ratios = MeasureColumnRatios(raw_[i], dark);
    if (!ratios) continue;
    const double even = std::log(ratios->even_rows), odd = std::log(ratios->odd_rows);
    if (!bayer) {
      // Speckle of some hundred columns averages to some per cent.
      if (std::abs(even) > 0.45 || std::abs(odd) > 0.45) {
        Error(
            "alternate pixels differ like those of a colour sensor, but camera.sensor_type is "
            "mono: another sensor",
            "colour pattern", {i});
      }
      continue;
    }
    // Compared in the rows where the colours differ most.
    const bool use_even = std::abs(std::log(expected_even)) >= std::abs(std::log(expected_odd));
    const double expected = std::log(use_even ? expected_even : expected_odd);
    const double seen = use_even ? even : odd;
    if (std::abs(expected) < 0.8) continue;
    ++compared;
    if (std::abs(seen) < 0.25 * std::abs(expected)) {
      flat.push_back(i);
    } else if (seen * expected < 0) {
      Error(
          "the colour pattern is shifted: roi_row_px and roi_column_px must start on a red "
          "pixel, the image does not",
          "colour pattern shifted", {i});
    }
  }
  if (flat.empty()) return;
  if (flat.size() < compared) {
    for (const int i : flat) {
      Error(
          "alternate pixels do not differ, but camera.sensor_type is bayer_rggb: another "
          "sensor, or no raw numbers",
          "no colour pattern", {i});
    }
    return;
  }
  // All alike: the sensor itself may be far from its description, which is for a diagnosis to
  // say.
  Warning(
      "alternate pixels do not differ in any recording, but camera.sensor_type is bayer_rggb: "
      "another sensor, no raw numbers, or quantum efficiencies far from the stated ones",
      "no colour pattern", flat);
}

void RecordingChecks::CheckDarkFrames() {
  std::vector<double> noise;
  std::vector<int> frames;
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || !IsDark(i) || blank_.count(i) > 0) continue;
    frames.push_back(i);
    const std::vector<uint16_t>& values = raw_[i].values;
    const double zeros = static_cast<double>(std::count(values.begin(), values.end(), 0)) /
                         static_cast<double>(values.size());
    if (zeros > 0.2 && NominalDark() > 3 * NominalDarkNoise()) {
      Warning(
          "many dark pixels are 0 although camera.dark_mean_electrons keeps them above it: "
          "black was subtracted, or the dark level is not as stated",
          "clipped at 0", {i});
    }
  }
  // Frames of about the same exposure differ by noise and drift only.
  for (size_t k = 0; k < frames.size(); ++k) {
    std::vector<double> others;
    for (size_t l = 0; l < frames.size(); ++l) {
      if (l != k) others.push_back(result_.recordings[frames[l]].mean_dn);
    }
    if (others.size() < 2) break;
    const double mean = result_.recordings[frames[k]].mean_dn;
    const auto [least, most] = std::minmax_element(others.begin(), others.end());
    const double tolerance = 2 * (*most - *least) + 3 * NominalDarkNoise() + 1;
    const bool longest = std::all_of(frames.begin(), frames.end(), [&](int i) {
      return set_.recordings[i].exposure_time_s <= set_.recordings[frames[k]].exposure_time_s;
    });
    // Dark current makes the longest exposure the brightest.
    if (mean < *least - tolerance || (mean > *most + tolerance && !longest)) {
      Warning(absl::StrFormat("its dark level of %.1f DN is far from that of the other dark "
                              "frames: another sensor, another setting of the camera, or stray "
                              "light",
                              mean),
              "dark level differs", {frames[k]});
    }
  }
  // Laser recordings cannot be darker than dark.
  if (frames.empty()) return;
  double darkest = 1e300;
  for (const int i : frames) darkest = std::min(darkest, result_.recordings[i].mean_dn);
  for (int i = 0; i < count_; ++i) {
    if (!Has(i) || !IsLaser(i) || blank_.count(i) > 0) continue;
    const int value = MedianValue(i);
    if (value < darkest - 3 * NominalDarkNoise() - 1) {
      Warning(absl::StrFormat("half of its pixels are at or below %d DN, darker than the dark "
                              "frames: another sensor, or another black level",
                              value),
              "darker than dark", {i});
    }
  }
}

void RecordingChecks::CheckGamma() {
  if (!set_.posed || out_of_range_) return;
  // Between the exponents of shot noise in raw numbers, 1, and with a gamma of 2.2, -0.2.
  constexpr double kBetween = 0.4;
  // Above, speckle or texture outweigh shot noise, which have 2 with any gamma.
  constexpr double kShotNoise = 1.4;
  const auto noise = MeasureSingleImageNoise(set_, raw_, set_.camera.largest_dn());
  if (!noise) {
    Warning("gamma: the levels of the images differ too little to tell whether the numbers are raw",
            "", {});
    return;
  }
  const double b = noise->exponent, error = noise->standard_error;
  const std::string measured = absl::StrFormat(
      "gamma: the variance of the noise in single images grows as level^%.2f (standard error "
      "%.2f); "
      "shot noise has 1 in raw numbers and 2 - g with a gamma of g",
      b, error);
  if (b + 2 * error < kBetween) {
    Error(absl::StrFormat("%s: numbers of a gamma of about %.1f; record raw numbers", measured,
                          2 - b),
          "", {});
  } else if (b - 2 * error > kShotNoise) {
    Warning(
        measured +
            ": more than shot noise, by speckle or texture, which have 2 with any gamma, so that "
            "it is undecided whether the numbers are raw",
        "", {});
  } else if (b - 2 * error > kBetween) {
    Warning(measured + ": they are taken as raw", "", {});
  } else {
    Warning(measured + ": it is undecided whether the numbers are raw; they are taken as such", "",
            {});
  }
}

void RecordingChecks::CheckLinearity() {
  if (out_of_range_) return;
  // A plateau below the largest number is a full well.
  const double full = all_[largest_seen_] >= 20 ? largest_seen_ : set_.camera.largest_dn();
  const Linearity linear = MeasureLinearity(set_, raw_, DarkLevel(), full);
  const bool noise_bent =
      linear.noise_exponent && *linear.noise_exponent + 4 * linear.noise_exponent_error < 0.5;
  const bool exposure_bent = linear.exposure_exponent && *linear.exposure_exponent < 0.75;
  if (!(noise_bent && (exposure_bent || !linear.exposure_exponent)) &&
      !(exposure_bent && !linear.noise_exponent)) {
    return;
  }
  std::string reason = "the numbers are not proportional to light:";
  if (linear.noise_exponent) {
    absl::StrAppend(&reason, absl::StrFormat(" their noise variance grows as signal^%.2f (raw: "
                                             "^0.75 to ^1)",
                                             *linear.noise_exponent));
  }
  if (linear.exposure_exponent) {
    absl::StrAppend(&reason, linear.noise_exponent ? " and" : "",
                    absl::StrFormat(" the signal as exposure_time_s^%.2f (raw: ^1)",
                                    *linear.exposure_exponent));
  }
  Error(absl::StrCat(reason, "; gamma or another curve was applied, record raw numbers"), "", {});
}

}  // namespace sightline
