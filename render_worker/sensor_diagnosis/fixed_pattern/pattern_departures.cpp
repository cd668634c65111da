// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/fixed_pattern/pattern_departures.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "absl/strings/str_format.h"
#include "core/statistics/normal_distribution.h"
#include "core/statistics/square.h"
#include "render_worker/sensor_diagnosis/departure_names.h"
#include "render_worker/sensor_diagnosis/fixed_pattern/line_patterns.h"
#include "render_worker/sensor_diagnosis/fixed_pattern/smooth_course.h"

namespace sightline {
namespace {

// Largest range of the light over the sensor that EMVA 1288 R4.0, clause 6.2, allows [1].
constexpr double kMaterialFallOff = 0.03;
// A larger difference of sensitivities in a cell is more than that of two converters: the sensor
// may have a colour filter [1]. Chosen.
constexpr double kColourFilterDifference = 0.05;

// Means of pixels in odd and even rows and columns: two converters or a colour filter make them
// differ.
Departure CellPattern(const FixedPattern& pattern) {
  const Image<double>& d = pattern.deviation;
  double sum[2][2] = {}, count[2][2] = {};
  for (int row = 0; row < d.rows_px; ++row) {
    for (int column = 0; column < d.columns_px; ++column) {
      sum[row % 2][column % 2] += d.At(row, column);
      count[row % 2][column % 2] += 1;
    }
  }
  double square = 0, largest = 0, least = 0;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      const double mean = sum[i][j] / count[i][j];
      square += Square(mean) * count[i][j] / pattern.variance;
      largest = std::max(largest, mean);
      least = std::min(least, mean);
    }
  }
  const double difference = largest - least;
  const char* colour = !pattern.dark && difference > kColourFilterDifference
                           ? "; a colour filter does this, and then every colour has to be "
                             "evaluated by itself"
                           : "";
  Departure departure{.effect = std::string(pattern.dark ? kDarkCellPattern : kBrightCellPattern),
                      .stage = "sensor",
                      .description = absl::StrFormat(
                          "cells of 2 x 2 pixels repeat: their pixels differ by up to %.3g %s%s",
                          difference, pattern.dark ? "DN" : "(relative)", colour),
                      .p_value = ChiSquaredTailP(square, 3),
                      .material = difference > kMaterialPattern * std::sqrt(pattern.variance)};
  departure.parameters.push_back({"difference", pattern.dark ? "DN" : "", difference,
                                  std::sqrt(2 * pattern.variance / count[0][0])});
  return departure;
}

// The number of outliers against that of a normal distribution, which is a Poisson number.
Departure OutlierPixels(const FixedPattern& pattern) {
  const double pixels = static_cast<double>(pattern.deviation.values.size());
  const double expected = pixels * NormalTwoSidedTail(kOutlierDeviations);
  const double count = static_cast<double>(pattern.outliers.size());
  Departure departure{
      .effect = pattern.dark ? NamesInVocabulary().hot_pixels : std::string(kDefectivePixels),
      .stage = "sensor",
      .description =
          absl::StrFormat("%.0f pixels (%.2g %%) lie more than %.0f standard deviations out %s",
                          count, 100 * count / pixels, kOutlierDeviations,
                          pattern.dark ? "in the dark" : "in their sensitivity"),
      .p_value = count > 0 ? 1 - ChiSquaredTailP(2 * expected, 2 * count) : 1,
      .material = count > 0};
  departure.parameters.push_back({"pixels", "", count, std::sqrt(std::max(count, 1.0))});
  return departure;
}

// The range of the smooth course of the light. The range of pure noise of all cells is about two
// standard errors.
Departure LightFallOff(const FixedPattern& bright) {
  const double pixels = static_cast<double>(bright.deviation.values.size());
  const double error = std::sqrt(bright.variance * kCellsPerSide * kCellsPerSide / pixels);
  Departure departure{.effect = std::string(kLightFallOff),
                      .stage = "illumination",
                      .description = absl::StrFormat(
                          "the light is not uniform: it varies smoothly by %.3g %% over the sensor",
                          100 * bright.smooth_range),
                      .p_value = NormalUpperTail(bright.smooth_range / error - 2),
                      .material = bright.smooth_range > kMaterialFallOff};
  departure.parameters.push_back({"range", "", bright.smooth_range, error});
  return departure;
}

std::vector<Departure> DeparturesOf(const FixedPattern& pattern) {
  std::vector<Departure> departures = LinePatterns(pattern);
  departures.push_back(CellPattern(pattern));
  departures.push_back(OutlierPixels(pattern));
  if (!pattern.dark) departures.push_back(LightFallOff(pattern));
  return departures;
}

Departure NotTestable(std::string_view name, const char* stage, std::string needs) {
  return {.effect = std::string(name), .stage = stage, .description = needs, .testable = false};
}

}  // namespace

std::vector<Departure> PatternDepartures(const FixedPatterns& patterns) {
  std::vector<Departure> departures;
  if (patterns.dark) {
    departures = DeparturesOf(*patterns.dark);
  } else {
    departures.push_back(NotTestable(
        kDarkPattern, "readout",
        absl::StrFormat("needs at least %d frames in the dark under the same conditions",
                        kFewestFramesOfPattern)));
  }
  if (patterns.bright) {
    for (Departure& departure : DeparturesOf(*patterns.bright)) {
      departures.push_back(std::move(departure));
    }
  } else {
    departures.push_back(NotTestable(
        kBrightPattern, "sensor",
        absl::StrFormat("needs at least %d frames under the same light, and as many dark",
                        kFewestFramesOfPattern)));
  }
  return departures;
}

}  // namespace sightline
