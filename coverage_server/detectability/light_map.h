// SPDX-License-Identifier: Apache-2.0
// LightLimit on a grid of distances and angles, for queries that ask it of very many places. A
// place takes the nearest entry. Steps are 1.7 to 2.4 degrees of incidence and 2.4 to 3.4 degrees
// between the directions.
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

  // Places along an axis of the grid, in [0, kSide - 1]: incidence angles by sqrt(1 - cosine), the
  // angle between the directions by the sine of its half, so that steps are about alike everywhere.
  static float IncidencePlace(float cosine) {
    return (kSide - 1) * std::sqrt(std::clamp(1 - cosine, 0.0F, 1.0F));
  }
  static float BetweenPlace(float cosine) {
    return (kSide - 1) * std::sqrt(std::clamp(0.5F * (1 - cosine), 0.0F, 1.0F));
  }

  // Whether a permitted exposure shows the line. The arguments are those of LightLimit::At.
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

  // Largest distance of the laser with which a permitted exposure may show the line, with this
  // incidence of camera or laser and whatever the rest is. 0: with none.
  float FarthestLaser(int16_t entry, float cosine) const {
    return farthest_m_[static_cast<size_t>(entry) * kSide + Nearest(IncidencePlace(cosine))];
  }

  // The least and the largest distance of the laser with which a permitted exposure shows the line,
  // for every cell; least above largest: none does. [entry][camera distance][incidence of the
  // camera][of the laser][angle between both][2].
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
