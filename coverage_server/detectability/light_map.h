// SPDX-License-Identifier: Apache-2.0
// Tabulates LightLimit on a grid of distances and angles, for queries at very many places. A place
// uses the nearest entry. Steps are 1.7 to 2.4 degrees of incidence and 2.4 to 3.4 degrees of the
// angle between the directions.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "coverage_server/detectability/light_limit.h"

namespace sightline {

class LightMap {
 public:
  static constexpr int kSide = 48;

  explicit LightMap(const LightLimit& limit);

  // Coordinates on the grid, in [0, kSide - 1]. Incidence angles are mapped by sqrt(1 - cosine),
  // the angle between the directions by the sine of its half, so that steps are nearly uniform.
  static float IncidencePlace(float cosine) {
    return (kSide - 1) * std::sqrt(std::clamp(1 - cosine, 0.0F, 1.0F));
  }
  static float BetweenPlace(float cosine) {
    return (kSide - 1) * std::sqrt(std::clamp(0.5F * (1 - cosine), 0.0F, 1.0F));
  }

  // True if a permitted exposure shows the line. Arguments as for LightLimit::At.
  bool Detects(int16_t entry, float camera_distance_m, float laser_distance_m, float cos_camera,
               float cos_laser, float cos_between) const {
    if (entry == LightLimit::kUnlimited) return true;
    const size_t cell =
        CellsBefore(entry) +
        ((DistanceBin(camera_distance_m) * kSide + Nearest(IncidencePlace(cos_camera))) * kSide +
         Nearest(IncidencePlace(cos_laser))) *
            kSide +
        Nearest(BetweenPlace(cos_between));
    return laser_distance_m >= distances_m_[2 * cell] &&
           laser_distance_m <= distances_m_[2 * cell + 1];
  }

  // Largest distance of the laser at which a permitted exposure can show the line, for this
  // incidence of camera or laser and any values of the other parameters. 0: none can.
  float FarthestLaser(int16_t entry, float cosine) const {
    return farthest_m_[static_cast<size_t>(entry) * kSide + Nearest(IncidencePlace(cosine))];
  }

  // Least and largest distance of the laser at which a permitted exposure shows the line, for every
  // cell; least above largest: none does. Indices: [entry][camera distance][incidence of the
  // camera][incidence of the laser][angle between both][2].
  const float* distances_m() const { return distances_m_.data(); }
  size_t CellsBefore(int16_t entry) const {
    return static_cast<size_t>(entry) * static_cast<size_t>(bins_) * kSide * kSide * kSide;
  }
  int bins() const { return bins_; }
  int64_t bytes() const { return static_cast<int64_t>(distances_m_.size() * sizeof(float)); }
  float first_bin_m() const { return first_bin_m_; }
  float bins_per_m() const { return bins_per_m_; }
  float BinDistance(int bin) const {
    return bins_per_m_ > 0 ? first_bin_m_ + static_cast<float>(bin) / bins_per_m_ : first_bin_m_;
  }

 private:
  static size_t Nearest(float place) { return static_cast<size_t>(place + 0.5F); }
  size_t DistanceBin(float distance_m) const {
    const float place = (distance_m - first_bin_m_) * bins_per_m_;
    return static_cast<size_t>(std::clamp(place, 0.0F, static_cast<float>(bins_ - 1)) + 0.5F);
  }

  int bins_ = 1;
  float first_bin_m_ = 0, bins_per_m_ = 0;
  std::vector<float> distances_m_;
  std::vector<float> farthest_m_;  // [entry][incidence]
};

}  // namespace sightline
