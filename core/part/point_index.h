// SPDX-License-Identifier: Apache-2.0
// Nearest-neighbour search over points.
#pragma once

#include <Eigen/Core>
#include <nanoflann.hpp>
#include <vector>

namespace sightline {

// k-d tree over points of `kDimensions` coordinates.
template <int kDimensions>
class PointIndex {
 public:
  using Point = Eigen::Matrix<float, kDimensions, 1>;

  explicit PointIndex(std::vector<Point> points)
      : cloud_{std::move(points)},
        tree_(kDimensions, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {}
  PointIndex(const PointIndex&) = delete;
  PointIndex& operator=(const PointIndex&) = delete;

  const std::vector<Point>& points() const { return cloud_.points; }

  // Index of the point nearest to `query`. There must be one.
  uint32_t Nearest(const Point& query) const {
    uint32_t index = 0;
    float distance_squared = 0;
    tree_.knnSearch(query.data(), 1, &index, &distance_squared);
    return index;
  }

  // Indices of the points nearer than `radius`, in no particular order.
  std::vector<uint32_t> Within(const Point& query, double radius) const {
    std::vector<Match> matches;
    tree_.radiusSearch(query.data(), static_cast<float>(radius * radius), matches,
                       nanoflann::SearchParams(0, 0, false));
    std::vector<uint32_t> indices;
    indices.reserve(matches.size());
    for (const Match& match : matches) indices.push_back(match.first);
    return indices;
  }

 private:
  using Match = std::pair<uint32_t, float>;
  struct Cloud {
    std::vector<Point> points;
    size_t kdtree_get_point_count() const { return points.size(); }
    float kdtree_get_pt(size_t i, size_t axis) const { return points[i][axis]; }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
      return false;
    }
  };
  Cloud cloud_;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud, float, uint32_t>,
                                      Cloud, kDimensions, uint32_t>
      tree_;
};

}  // namespace sightline
