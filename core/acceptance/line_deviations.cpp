// SPDX-License-Identifier: Apache-2.0
#include "core/acceptance/line_deviations.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sightline {

LineDeviations::LineDeviations(std::vector<Frame> frames, bool repeats)
    : frames_(std::move(frames)), repeats_(repeats) {
  std::sort(frames_.begin(), frames_.end(),
            [](const Frame& a, const Frame& b) { return a.stage_m < b.stage_m; });
}

int LineDeviations::realisations() const {
  return frames_.empty() ? 0 : static_cast<int>(frames_.front().realisations.size());
}

const LineDeviations::Frame& LineDeviations::Nearest(double stage_m) const {
  const auto above =
      std::lower_bound(frames_.begin(), frames_.end(), stage_m,
                       [](const Frame& frame, double stage) { return frame.stage_m < stage; });
  if (above == frames_.begin()) return frames_.front();
  if (above == frames_.end()) return frames_.back();
  const auto below = std::prev(above);
  return stage_m - below->stage_m < above->stage_m - stage_m ? *below : *above;
}

std::optional<double> LineDeviations::At(double stage_m, int column, int realisation) const {
  if (frames_.empty()) return std::nullopt;
  const Frame& frame = Nearest(stage_m);
  const std::vector<float>& rows = frame.realisations[static_cast<size_t>(realisation)].rows_px;
  const auto columns = static_cast<int>(rows.size());
  int index = column - frame.first_column;
  if (repeats_ && columns > 0) index = ((index % columns) + columns) % columns;
  if (index < 0 || index >= columns) return std::nullopt;
  const double deviation_px = rows[static_cast<size_t>(index)];
  if (!std::isfinite(deviation_px)) return std::nullopt;
  return deviation_px;
}

LineDeviations::Mean LineDeviations::MeanAt(double stage_m, int column) const {
  Mean mean;
  for (int r = 0; r < realisations(); ++r) {
    const std::optional<double> deviation_px = At(stage_m, column, r);
    if (!deviation_px) continue;
    mean.deviation_px += *deviation_px;
    ++mean.count;
  }
  if (mean.count > 0) mean.deviation_px /= mean.count;
  return mean;
}

}  // namespace sightline
