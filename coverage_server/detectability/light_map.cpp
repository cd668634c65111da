// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/detectability/light_map.h"

#include <limits>

namespace sightline {
namespace {

// Number of camera distances of the grid if a table has several; a material then takes 14 MB.
constexpr int kDistanceBins = 16;

}  // namespace

LightMap::LightMap(const LightLimit& limit) {
  double first_m = std::numeric_limits<double>::infinity(), last_m = 0;
  for (const ExposureTable& table : limit.tables()) {
    first_m = std::min(first_m, table.camera_distances_m().front());
    last_m = std::max(last_m, table.camera_distances_m().back());
  }
  first_bin_m_ = static_cast<float>(first_m);
  if (last_m > first_m) {
    bins_ = kDistanceBins;
    bins_per_m_ = static_cast<float>((kDistanceBins - 1) / (last_m - first_m));
  }
  const auto incidence_cosine = [](int i) {
    const double place = static_cast<double>(i) / (kSide - 1);
    return 1 - place * place;
  };
  distances_m_.reserve(2 * CellsBefore(static_cast<int16_t>(limit.tables().size())));
  for (const ExposureTable& table : limit.tables()) {
    farthest_m_.resize(farthest_m_.size() + kSide, 0);
    for (int bin = 0; bin < bins_; ++bin) {
      for (int camera = 0; camera < kSide; ++camera) {
        for (int laser = 0; laser < kSide; ++laser) {
          for (int between = 0; between < kSide; ++between) {
            // Exposure times grow in proportion to the laser's distance: use 1 m.
            const ExposureRange needed =
                table.At(double{BinDistance(bin)}, 1, incidence_cosine(camera),
                         incidence_cosine(laser), 2 * incidence_cosine(between) - 1);
            const auto least_m = static_cast<float>(limit.shortest_s() / needed.longest_s),
                       most_m = static_cast<float>(limit.longest_s() / needed.shortest_s);
            distances_m_.push_back(least_m);
            distances_m_.push_back(most_m);
            if (least_m > most_m) continue;
            for (const int incidence : {camera, laser}) {
              float& farthest_m = farthest_m_[farthest_m_.size() - kSide + incidence];
              farthest_m = std::max(farthest_m, most_m);
            }
          }
        }
      }
    }
  }
}

}  // namespace sightline
