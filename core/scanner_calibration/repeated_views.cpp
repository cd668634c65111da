// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/repeated_views.h"

#include <cmath>

namespace sightline {
namespace {

// Root mean square distance of the corners of two views, which have as many.
double CornersApart_px(const std::vector<Eigen::Vector2d>& a,
                       const std::vector<Eigen::Vector2d>& b) {
  double sum_px2 = 0;
  for (size_t i = 0; i < a.size(); ++i) sum_px2 += (a[i] - b[i]).squaredNorm();
  return std::sqrt(sum_px2 / static_cast<double>(a.size()));
}

}  // namespace

std::vector<std::optional<RepeatedView>> FindRepeatedViews(
    const std::vector<std::vector<Eigen::Vector2d>>& corners_px) {
  std::vector<std::optional<RepeatedView>> repeated(corners_px.size());
  for (size_t i = 0; i < corners_px.size(); ++i) {
    if (corners_px[i].empty()) continue;
    for (size_t k = 0; k < i && !repeated[i]; ++k) {
      if (repeated[k] || corners_px[k].size() != corners_px[i].size()) continue;
      const double apart_px = CornersApart_px(corners_px[i], corners_px[k]);
      if (apart_px < kSameView_px) repeated[i] = RepeatedView{k, apart_px};
    }
  }
  return repeated;
}

}  // namespace sightline
