// SPDX-License-Identifier: Apache-2.0
#include "core/resting/convex_hull.h"

// The C interface: headers of the C++ one do not compile as C++20.
extern "C" {
#include <libqhull_r/qhull_ra.h>
}

#include <Eigen/Geometry>
#include <cstdio>
#include <limits>
#include <memory>
#include <unordered_map>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

constexpr char kFlat[] = "the part is flat: its surface encloses no volume";

// A run of qhull with its messages, which are ignored.
class QhullRun {
 public:
  QhullRun() : said_(std::fopen("/dev/null", "w")) { qh_zero(&state_, said_); }
  ~QhullRun() {
    qh_freeqhull(&state_, !qh_ALL);
    int kept = 0, bytes = 0;
    qh_memfreeshort(&state_, &kept, &bytes);
    if (said_ != nullptr) std::fclose(said_);
  }
  QhullRun(const QhullRun&) = delete;
  QhullRun& operator=(const QhullRun&) = delete;

  // 0, or one of qh_ERR...
  int Run(int dimension, std::vector<double>& coordinates) {
    // Triangulated output without warnings; the string is written to.
    char command[] = "qhull Qt Pp";
    return qh_new_qhull(&state_, dimension, static_cast<int>(coordinates.size()) / dimension,
                        coordinates.data(), False, command, nullptr, said_);
  }
  qhT* state() { return &state_; }

 private:
  std::FILE* said_;
  qhT state_;
};

}  // namespace

absl::StatusOr<ConvexHull> MakeConvexHull(std::span<const Eigen::Vector3f> points_m) {
  if (points_m.size() < 4) return absl::InvalidArgumentError(kFlat);
  // About the middle and of size 1: qhull's tolerances follow from the largest coordinate.
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& p : points_m) box.extend(p.cast<double>());
  const double size = box.sizes().maxCoeff();
  if (!(size > 0)) return absl::InvalidArgumentError(kFlat);
  std::vector<double> coordinates;
  coordinates.reserve(3 * points_m.size());
  for (const Eigen::Vector3f& p : points_m) {
    const Eigen::Vector3d scaled = (p.cast<double>() - box.center()) / size;
    coordinates.insert(coordinates.end(), scaled.data(), scaled.data() + 3);
  }
  const auto run = std::make_unique<QhullRun>();
  const int error = run->Run(3, coordinates);
  // No first simplex, or none that rounding leaves a volume.
  if (error == qh_ERRsingular || error == qh_ERRprec) return absl::InvalidArgumentError(kFlat);
  if (error != 0) return absl::InternalError(absl::StrCat("qhull: error ", error));

  ConvexHull hull;
  qhT* qh = run->state();
  std::unordered_map<int, uint32_t> corner_of;
  Eigen::Vector3d inside = Eigen::Vector3d::Zero();
  facetT* facet;
  FORALLfacets {
    std::array<uint32_t, 3> triangle{};
    size_t count = 0;
    vertexT *vertex, **vertexp;
    FOREACHvertex_(facet->vertices) {
      const int id = qh_pointid(qh, vertex->point);
      if (id < 0 || count == 3) return absl::InternalError("qhull: a facet is not a triangle");
      const auto [it, added] =
          corner_of.try_emplace(id, static_cast<uint32_t>(hull.corners_m.size()));
      if (added) {
        hull.corners_m.push_back(points_m[static_cast<size_t>(id)].cast<double>());
        inside += hull.corners_m.back();
      }
      triangle[count++] = it->second;
    }
    if (count != 3) return absl::InternalError("qhull: a facet is not a triangle");
    hull.triangles.push_back(triangle);
  }
  inside /= static_cast<double>(hull.corners_m.size());
  for (auto& [a, b, c] : hull.triangles) {
    const Eigen::Vector3d corner = hull.corners_m[a];
    const Eigen::Vector3d normal = (hull.corners_m[b] - corner).cross(hull.corners_m[c] - corner);
    if (normal.dot(corner - inside) < 0) std::swap(b, c);
  }
  return hull;
}

double SupportHeight(std::span<const Eigen::Vector3d> points_m, const Eigen::Vector3d& direction) {
  double highest = -std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& p : points_m) highest = std::max(highest, direction.dot(p));
  return highest;
}

}  // namespace sightline
