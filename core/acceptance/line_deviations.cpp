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

std::optional<double> LineDeviations::At(const Frame& frame, const Realisation& line,
                                         int column) const {
  const auto columns = static_cast<int>(line.rows_px.size());
  int index = column - frame.first_column;
  if (repeats_ && columns > 0) index = ((index % columns) + columns) % columns;
  if (index < 0 || index >= columns) return std::nullopt;
  const double deviation_px = line.rows_px[static_cast<size_t>(index)];
  if (!std::isfinite(deviation_px)) return std::nullopt;
  return deviation_px;
}

std::optional<double> LineDeviations::Systematic(double stage_m, int column) const {
  if (frames_.empty()) return std::nullopt;
  const Frame& frame = Nearest(stage_m);
  return At(frame, frame.systematic, column);
}

std::optional<double> LineDeviations::Drawn(double stage_m, int column, int realisation,
                                            int sign) const {
  if (frames_.empty()) return std::nullopt;
  const Frame& frame = Nearest(stage_m);
  const std::optional<double> systematic = At(frame, frame.systematic, column);
  const std::optional<double> deviation =
      At(frame, frame.realisations[static_cast<size_t>(realisation)], column);
  if (!systematic || !deviation) return std::nullopt;
  return *systematic + sign * (*deviation - *systematic);
}

}  // namespace sightline
