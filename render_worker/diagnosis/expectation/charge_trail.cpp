// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/charge_trail.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sightline {

namespace {

int CrestRow(const std::vector<double>& light) {
  return static_cast<int>(std::max_element(light.begin(), light.end()) - light.begin());
}

// Contrast of a column's sum of `light` by row over that of a pixel.
double ContrastKept(const std::vector<double>& light, const FrameSetup& frame,
                    const LineSpeckle& speckle) {
  const SpecklePixelCovariance& crest = speckle.At(
      speckle.PlaceOf((frame.roi.row_px + CrestRow(light)) * frame.sensor.pixel_pitch_m));
  const int rows = static_cast<int>(light.size());
  double sum = 0, product = 0;
  for (int a = 0; a < rows; ++a) {
    sum += light[a];
    const int last = std::min(rows - 1, a + crest.max_lag());
    for (int b = std::max(0, a - crest.max_lag()); b <= last; ++b) {
      product += light[a] * light[b] * crest.At(b - a, 0);
    }
  }
  return sum > 0 ? std::sqrt(std::max(0.0, product / crest.At(0, 0))) / sum : 0;
}

}  // namespace

bool IsSmear(const ActiveEffect& active) {
  return active.effect->description().column_transport == ColumnTransport::kReadout;
}

SmearTrail TrailOfSmear(const Image<double>& total, const Image<double>& steady,
                        const FrameSetup& frame, std::span<const ActiveEffect> effects,
                        const LineSpeckle* speckle) {
  SmearTrail trail;
  const auto smear = std::find_if(effects.begin(), effects.end(), IsSmear);
  if (smear == effects.end() || smear->parameters[0] == 0) return trail;
  const auto added = [&](const Image<double>& electrons) {
    Image<double> after = electrons;
    smear->effect->OnMeanElectrons(after, nullptr, frame, smear->parameters);
    for (size_t i = 0; i < after.values.size(); ++i) after.values[i] -= electrons.values[i];
    return after;
  };
  trail.steady = added(steady);
  trail.laser = added(total);
  for (size_t i = 0; i < trail.laser.values.size(); ++i) {
    trail.laser.values[i] -= trail.steady.values[i];
  }
  if (speckle == nullptr) return trail;
  std::vector<double> light(total.rows_px);
  for (int row = 0; row < total.rows_px; ++row) light[row] = total.At(row, 0) - steady.At(row, 0);
  trail.crest_row = CrestRow(light);
  trail.contrast_kept = ContrastKept(light, frame, *speckle);
  return trail;
}

bool IsBlooming(const ActiveEffect& active) {
  return active.effect->description().column_transport == ColumnTransport::kOverflow;
}

void EvenOutOverflow(const ActiveEffect& blooming, const FrameSetup& frame,
                     const LineSpeckle& speckle, const std::vector<Image<double>>& without,
                     std::vector<Image<double>>& with) {
  const double fraction = blooming.parameters[0], threshold = blooming.parameters[1];
  const auto levels = static_cast<double>(with.size());
  const int columns = with.front().columns_px, rows = with.front().rows_px;
  const auto surplus = [&](size_t level, size_t pixel) {
    return fraction * std::max(0.0, without[level].values[pixel] - threshold);
  };
  const auto inflow = [&](size_t level, size_t pixel) {
    return with[level].values[pixel] - without[level].values[pixel] + surplus(level, pixel);
  };
  std::vector<double> source(rows, 0);
  for (int row = 0; row < rows; ++row) {
    for (size_t l = 0; l < with.size(); ++l) {
      source[row] += surplus(l, static_cast<size_t>(row) * columns) / levels;
    }
  }
  const double kept = ContrastKept(source, frame, speckle);
  for (size_t i = 0; i < with.front().values.size(); ++i) {
    double mean = 0;
    for (size_t l = 0; l < with.size(); ++l) mean += inflow(l, i) / levels;
    for (size_t l = 0; l < with.size(); ++l) {
      with[l].values[i] += (kept - 1) * (inflow(l, i) - mean);
    }
  }
}

}  // namespace sightline
