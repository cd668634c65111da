// SPDX-License-Identifier: Apache-2.0
// Poisson-disk sampling in two steps.
//  1. Dart throwing over a dense, shuffled, area-weighted sampling of the surface (Corsini,
//     Cignoni, Scopigno: Efficient and Flexible Sampling with Blue Noise Properties of Triangular
//     Meshes, IEEE TVCG 18(6), 2012).
//  2. Dense random candidates still leave gaps. Triangles are therefore divided until each piece is
//     wholly inside the disk of one target or small; centres of small uncovered pieces become
//     targets too, in random order (as the void filling of Ebeida et al., Eurographics 2012).
// Step 2 makes the sampling maximal up to the size of a piece: no place is farther than
// (1 + 2/3 kPieceSize) spacings from a target on a side that faces the same way.
#include "core/targets/poisson_disk.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Candidates per target that fits.
constexpr double kCandidatesPerTarget = 12;
constexpr double kMaxTargets = 2e6;
// Longest edge of the smallest pieces in spacings.
constexpr double kPieceSize = 0.08;
// "Within 90 degrees" with a margin against rounding: faces of a box are perpendicular and each
// gets its own targets.
constexpr float kMinNormalDot = 0.01f;

// SplitMix64 (Steele, Lea, Flood 2014): same numbers on every machine.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t Next() {
    uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  // In [0, 1).
  double Uniform() { return static_cast<double>(Next() >> 11) * 0x1p-53; }
  // In [0, n), n < 2^32.
  uint32_t Below(uint32_t n) { return static_cast<uint32_t>(((Next() >> 32) * n) >> 32); }

 private:
  uint64_t state_;
};

// False if `stop` said so on the way: millions of items take a while.
template <typename T, typename Stop>
bool Shuffle(std::vector<T>* items, Random* random, const Stop& stop) {
  for (size_t i = items->size(); i > 1; --i) {
    if (stop()) return false;
    std::swap((*items)[i - 1], (*items)[random->Below(static_cast<uint32_t>(i))]);
  }
  return true;
}

struct Point {
  Eigen::Vector3f position_m;
  Eigen::Vector3f normal;
  uint32_t triangle = 0;
  int32_t region = -1;
};

// Finds the region that a place belongs to: the one with the smallest spacing, the first of equals.
class Regions {
 public:
  explicit Regions(const TargetSampling& sampling) : sampling_(sampling) {}

  int32_t At(const Eigen::Vector3d& p) const {
    int32_t best = -1;
    for (size_t i = 0; i < sampling_.regions.size(); ++i) {
      const TargetRegion& region = sampling_.regions[i];
      const bool inside =
          (p.array() >= region.min_m.array()).all() && (p.array() <= region.max_m.array()).all();
      if (inside && (best < 0 || region.spacing_m < sampling_.regions[best].spacing_m)) {
        best = static_cast<int32_t>(i);
      }
    }
    return best;
  }
  double Spacing(int32_t region) const {
    return region < 0 ? sampling_.spacing_m : sampling_.regions[region].spacing_m;
  }
  // Bounds of the spacings that places in the box have.
  double SmallestIn(const Eigen::AlignedBox3d& box) const {
    double smallest = std::numeric_limits<double>::infinity();
    bool general = true;  // the general spacing applies somewhere
    for (const TargetRegion& region : sampling_.regions) {
      const Eigen::AlignedBox3d region_box(region.min_m, region.max_m);
      if (!region_box.intersects(box)) continue;
      smallest = std::min(smallest, region.spacing_m);
      general = general && !region_box.contains(box);
    }
    return general ? std::min(smallest, sampling_.spacing_m) : smallest;
  }
  double LargestIn(const Eigen::AlignedBox3d& box) const {
    double around = std::numeric_limits<double>::infinity();
    double largest = sampling_.spacing_m;
    for (const TargetRegion& region : sampling_.regions) {
      const Eigen::AlignedBox3d region_box(region.min_m, region.max_m);
      if (region_box.contains(box)) around = std::min(around, region.spacing_m);
      if (region_box.intersects(box)) largest = std::max(largest, region.spacing_m);
    }
    return std::min(around, largest);
  }

 private:
  const TargetSampling& sampling_;
};

// A triangle or a part of one.
struct Piece {
  Eigen::Vector3d corners[3];

  Eigen::AlignedBox3d Box() const {
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& corner : corners) box.extend(corner);
    return box;
  }
  double Area() const {
    return 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).norm();
  }
  Eigen::Vector3d Centre() const { return (corners[0] + corners[1] + corners[2]) / 3; }
  // Index of the corner where the longest edge starts, and that edge's squared length.
  std::pair<int, double> LongestEdge() const {
    std::pair<int, double> longest(0, 0);
    for (int k = 0; k < 3; ++k) {
      const double length2 = (corners[(k + 1) % 3] - corners[k]).squaredNorm();
      if (length2 > longest.second) longest = {k, length2};
    }
    return longest;
  }
  // Two halves, cut through the middle of the longest edge.
  std::array<Piece, 2> Halves() const {
    const int k = LongestEdge().first;
    const Eigen::Vector3d middle = 0.5 * (corners[k] + corners[(k + 1) % 3]);
    std::array<Piece, 2> halves = {*this, *this};
    halves[0].corners[k] = middle;
    halves[1].corners[(k + 1) % 3] = middle;
    return halves;
  }
};

Piece WholeTriangle(const TriangleMesh& mesh, size_t t) {
  return {{mesh.Corner(t, 0), mesh.Corner(t, 1), mesh.Corner(t, 2)}};
}

// Accepted targets of one spacing in a hashed grid whose cells are one spacing wide.
class Grid {
 public:
  explicit Grid(double spacing_m) : spacing_m_(spacing_m), slots_(1024) {}

  double spacing_m() const { return spacing_m_; }

  void Add(const Point& point) {
    if (2 * (points_.size() + 1) > slots_.size()) Grow();
    const uint64_t key = Key(Cell(point.position_m));
    Slot& slot = Find(key);
    points_.push_back({point.position_m, point.normal, slot.first});
    slot = {key, static_cast<uint32_t>(points_.size() - 1)};
  }

  // Calls `visit(position)` for targets that face as `normal` does and may lie within `radius_m`
  // (at most one spacing) of `position`, until it returns true. Returns whether it did.
  template <typename Visit>
  bool AnyNear(const Eigen::Vector3f& position, const Eigen::Vector3f& normal, double radius_m,
               Visit visit) const {
    if (points_.empty()) return false;
    const std::array<int64_t, 3> low = Cell(position.array() - static_cast<float>(radius_m));
    const std::array<int64_t, 3> high = Cell(position.array() + static_cast<float>(radius_m));
    for (int64_t x = low[0]; x <= high[0]; ++x) {
      for (int64_t y = low[1]; y <= high[1]; ++y) {
        for (int64_t z = low[2]; z <= high[2]; ++z) {
          for (uint32_t i = Find(Key({x, y, z})).first; i != kNone; i = points_[i].next) {
            const Entry& entry = points_[i];
            if (entry.normal.dot(normal) > kMinNormalDot && visit(entry.position_m)) return true;
          }
        }
      }
    }
    return false;
  }

 private:
  static constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
  struct Entry {
    Eigen::Vector3f position_m, normal;
    uint32_t next;  // in the same cell
  };
  struct Slot {
    uint64_t key = 0;
    uint32_t first = kNone;  // kNone: free
  };

  std::array<int64_t, 3> Cell(const Eigen::Vector3f& p) const {
    std::array<int64_t, 3> cell;
    for (int axis = 0; axis < 3; ++axis) {
      cell[axis] = static_cast<int64_t>(std::floor(p[axis] / spacing_m_));
    }
    return cell;
  }
  static uint64_t Key(const std::array<int64_t, 3>& cell) {
    // 21 bits each: 10 m at a spacing of 0.1 mm needs 17.
    constexpr uint64_t kMask = (1 << 21) - 1;
    return (static_cast<uint64_t>(cell[0]) & kMask) << 42 |
           (static_cast<uint64_t>(cell[1]) & kMask) << 21 |
           (static_cast<uint64_t>(cell[2]) & kMask);
  }
  size_t SlotIndex(uint64_t key) const {
    const size_t mask = slots_.size() - 1;
    size_t i = (key * 0x9e3779b97f4a7c15u) >> 32 & mask;
    while (slots_[i].first != kNone && slots_[i].key != key) i = (i + 1) & mask;
    return i;
  }
  const Slot& Find(uint64_t key) const { return slots_[SlotIndex(key)]; }
  Slot& Find(uint64_t key) { return slots_[SlotIndex(key)]; }

  void Grow() {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    for (const Slot& slot : old) {
      if (slot.first != kNone) Find(slot.key) = slot;
    }
  }

  double spacing_m_;
  std::vector<Slot> slots_;  // a power of two
  std::vector<Entry> points_;
};

class Sampler {
 public:
  Sampler(const TriangleMesh& mesh, const TargetSampling& sampling,
          const std::atomic<bool>* cancelled)
      : mesh_(mesh),
        cancelled_(cancelled),
        regions_(sampling),
        random_(static_cast<uint64_t>(sampling.seed)) {
    std::vector<double> spacings = {sampling.spacing_m};
    for (const TargetRegion& region : sampling.regions) spacings.push_back(region.spacing_m);
    std::sort(spacings.begin(), spacings.end());
    spacings.erase(std::unique(spacings.begin(), spacings.end()), spacings.end());
    for (double spacing : spacings) grids_.emplace_back(spacing);
  }

  absl::StatusOr<std::vector<Point>> Run() {
    SIGHTLINE_RETURN_IF_ERROR(ThrowDarts());
    SIGHTLINE_RETURN_IF_ERROR(FillGaps());
    return std::move(accepted_);
  }

 private:
  static absl::Status TooMany(double estimate) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "the spacing asks for about ", static_cast<int64_t>(estimate),
        " targets on this part, at most ", static_cast<int64_t>(kMaxTargets), " are possible"));
  }

  static absl::Status Cancelled() { return absl::CancelledError("target sampling"); }

  // Called for every piece and candidate; reads the flag only every 1024th time.
  bool ShouldStop() {
    if (cancelled_ == nullptr || ++asked_ % 1024 != 0) return false;
    return cancelled_->load(std::memory_order_relaxed);
  }

  // Calls visit(piece, spacing) for parts of a triangle in which spacings hardly mix, `spacing`
  // being the smallest there: a large triangle that touches a dense region is not sampled densely
  // all over. False: to be stopped.
  template <typename Visit>
  bool ForEvenPieces(size_t t, Visit visit) {
    std::vector<Piece>& open = open_pieces_;
    open = {WholeTriangle(mesh_, t)};
    while (!open.empty()) {
      if (ShouldStop()) return false;
      const Piece piece = open.back();
      open.pop_back();
      const Eigen::AlignedBox3d box = piece.Box();
      const double smallest = regions_.SmallestIn(box);
      if (regions_.LargestIn(box) > smallest &&
          piece.LongestEdge().second > 16 * smallest * smallest) {
        for (const Piece& half : piece.Halves()) open.push_back(half);
      } else {
        visit(piece, smallest);
      }
    }
    return true;
  }

  absl::Status ThrowDarts() {
    const auto targets_on = [](const Piece& piece, double spacing) {
      return kTargetsPerSpacing2 * piece.Area() / (spacing * spacing);
    };
    double targets = 0;
    for (size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const bool done = ForEvenPieces(
          t, [&](const Piece& piece, double spacing) { targets += targets_on(piece, spacing); });
      if (!done) return Cancelled();
      if (targets > 2 * kMaxTargets) return TooMany(targets);  // the count itself decides later
    }
    std::vector<Point> candidates;
    candidates.reserve(static_cast<size_t>(targets * kCandidatesPerTarget) + 1);
    // Systematic sampling: every piece gets its expected number, rounded up or down.
    double offset = random_.Uniform();
    for (size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const Eigen::Vector3d normal = mesh_.Normal(t);
      if (normal.isZero(0)) continue;
      bool stopped = false;
      const bool done = ForEvenPieces(t, [&](const Piece& piece, double spacing) {
        offset += kCandidatesPerTarget * targets_on(piece, spacing);
        for (; offset >= 1 && !stopped; offset -= 1) {
          stopped = ShouldStop();
          double u = random_.Uniform(), v = random_.Uniform();
          const double keep = random_.Uniform();
          if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
          }
          const Eigen::Vector3d& a = piece.corners[0];
          const Eigen::Vector3d p = a + u * (piece.corners[1] - a) + v * (piece.corners[2] - a);
          const int32_t region = regions_.At(p);
          // Thins where this place is coarser than the finest of its piece.
          const double ratio = spacing / regions_.Spacing(region);
          if (keep >= ratio * ratio) continue;
          candidates.push_back(
              {p.cast<float>(), normal.cast<float>(), static_cast<uint32_t>(t), region});
        }
      });
      if (stopped || !done) return Cancelled();
    }
    if (!Shuffle(&candidates, &random_, [this] { return ShouldStop(); })) return Cancelled();
    for (const Point& candidate : candidates) {
      if (ShouldStop()) return Cancelled();
      SIGHTLINE_RETURN_IF_ERROR(Try(candidate));
    }
    return absl::OkStatus();
  }

  // Accepts a point unless it is too near an accepted one.
  absl::Status Try(const Point& point) {
    const double spacing = regions_.Spacing(point.region);
    if (IsCovered(point.position_m, point.normal, spacing)) return absl::OkStatus();
    if (accepted_.size() >= static_cast<size_t>(kMaxTargets)) return TooMany(kMaxTargets + 1);
    for (Grid& grid : grids_) {
      if (grid.spacing_m() == spacing) grid.Add(point);
    }
    accepted_.push_back(point);
    return absl::OkStatus();
  }

  // Between two spacings the smaller one counts: a coarse target does not thin a dense region.
  bool IsCovered(const Eigen::Vector3f& position, const Eigen::Vector3f& normal,
                 double spacing) const {
    for (const Grid& grid : grids_) {
      const double radius = std::min(spacing, grid.spacing_m());
      const float radius2 = static_cast<float>(radius * radius);
      if (grid.AnyNear(position, normal, radius, [&](const Eigen::Vector3f& q) {
            return (q - position).squaredNorm() < radius2;
          })) {
        return true;
      }
    }
    return false;
  }

  // Whether one target's disk holds the whole piece.
  bool IsInsideOneDisk(const Piece& piece, const Eigen::Vector3f& normal, double spacing) const {
    const Eigen::Vector3f centre = piece.Centre().cast<float>();
    for (const Grid& grid : grids_) {
      const double radius = std::min(spacing, grid.spacing_m());
      const double radius2 = radius * radius;
      if (grid.AnyNear(centre, normal, radius, [&](const Eigen::Vector3f& q) {
            const Eigen::Vector3d target = q.cast<double>();
            return (piece.corners[0] - target).squaredNorm() < radius2 &&
                   (piece.corners[1] - target).squaredNorm() < radius2 &&
                   (piece.corners[2] - target).squaredNorm() < radius2;
          })) {
        return true;
      }
    }
    return false;
  }

  absl::Status FillGaps() {
    std::vector<Point> gaps;
    std::vector<Piece> open;
    for (size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const Eigen::Vector3d normal = mesh_.Normal(t);
      if (normal.isZero(0)) continue;
      const Eigen::Vector3f normal_f = normal.cast<float>();
      open = {WholeTriangle(mesh_, t)};
      while (!open.empty()) {
        if (ShouldStop()) return Cancelled();
        const Piece piece = open.back();
        open.pop_back();
        const double spacing = regions_.SmallestIn(piece.Box());
        const double longest2 = piece.LongestEdge().second;
        // A disk cannot hold an edge longer than its diameter.
        const bool may_fit = longest2 < 4 * spacing * spacing;
        if (may_fit && IsInsideOneDisk(piece, normal_f, spacing)) continue;
        if (longest2 > kPieceSize * kPieceSize * spacing * spacing) {
          for (const Piece& half : piece.Halves()) open.push_back(half);
          continue;
        }
        const Eigen::Vector3d centre = piece.Centre();
        const int32_t region = regions_.At(centre);
        const Point point{centre.cast<float>(), normal_f, static_cast<uint32_t>(t), region};
        if (!IsCovered(point.position_m, normal_f, regions_.Spacing(region))) gaps.push_back(point);
      }
    }
    // In the order of triangles the new targets would crowd at one end of each gap.
    if (!Shuffle(&gaps, &random_, [this] { return ShouldStop(); })) return Cancelled();
    for (const Point& point : gaps) {
      if (ShouldStop()) return Cancelled();
      SIGHTLINE_RETURN_IF_ERROR(Try(point));
    }
    return absl::OkStatus();
  }

  const TriangleMesh& mesh_;
  const std::atomic<bool>* const cancelled_;
  uint32_t asked_ = 0;
  Regions regions_;
  Random random_;
  std::vector<Grid> grids_;
  std::vector<Point> accepted_;
  std::vector<Piece> open_pieces_;  // of ForEvenPieces, kept to save allocations
};

// Spreads the low 10 bits to every third bit.
uint32_t Spread(uint32_t x) {
  x &= 0x3ff;
  x = (x | x << 16) & 0x030000ff;
  x = (x | x << 8) & 0x0300f00f;
  x = (x | x << 4) & 0x030c30c3;
  x = (x | x << 2) & 0x09249249;
  return x;
}

// Position on a Morton curve of 1024 cells a side over the mesh, then the octant of the normal.
uint64_t MortonKey(const Point& point, const Eigen::AlignedBox3d& box) {
  const double size = std::max(box.sizes().maxCoeff(), 1e-12);
  uint32_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double cell = (point.position_m[axis] - box.min()[axis]) / size * 1024;
    code |= Spread(static_cast<uint32_t>(std::clamp(cell, 0.0, 1023.0))) << axis;
  }
  const uint64_t octant = (point.normal.x() < 0 ? 1 : 0) | (point.normal.y() < 0 ? 2 : 0) |
                          (point.normal.z() < 0 ? 4 : 0);
  return uint64_t{code} << 3 | octant;
}

}  // namespace

absl::StatusOr<TargetSet> SampleTargets(const TriangleMesh& mesh, const TargetSampling& sampling,
                                        const std::atomic<bool>* cancelled) {
  double area_m2 = 0;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) area_m2 += mesh.Area(t);
  if (!(area_m2 > 0)) {
    return absl::InvalidArgumentError("the mesh has no surface to put targets on");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(std::vector<Point> points, Sampler(mesh, sampling, cancelled).Run());

  const Eigen::AlignedBox3d box = mesh.BoundingBox();
  std::vector<std::pair<uint64_t, uint32_t>> order(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    order[i] = {MortonKey(points[i], box), static_cast<uint32_t>(i)};
  }
  std::sort(order.begin(), order.end());
  TargetSet targets;
  targets.positions_m.reserve(order.size());
  targets.normals.reserve(order.size());
  targets.regions.reserve(order.size());
  targets.triangles.reserve(order.size());
  for (const auto& [key, i] : order) {
    const Point& point = points[i];
    targets.positions_m.push_back(point.position_m);
    targets.normals.push_back(point.normal);
    targets.regions.push_back(point.region);
    targets.triangles.push_back(point.triangle);
  }
  return targets;
}

}  // namespace sightline
