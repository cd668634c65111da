// SPDX-License-Identifier: Apache-2.0
#include "core/targets/poisson_disk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <thread>
#include <tuple>

#include "core/part/load_part.h"
#include "tests/core/part/test_meshes.h"
#include "tests/limits/cpu_time.h"
#include "tests/limits/within_limits.h"

namespace sightline {
namespace {

TargetSampling Spacing(double spacing_m, int64_t seed = 1) {
  TargetSampling sampling;
  sampling.spacing_m = spacing_m;
  sampling.seed = seed;
  return sampling;
}

TargetSet Sample(const TriangleMesh& mesh, const TargetSampling& sampling) {
  const absl::StatusOr<TargetSet> targets = SampleTargets(mesh, sampling);
  EXPECT_TRUE(targets.ok()) << targets.status();
  return targets.ok() ? *targets : TargetSet();
}

// Independent neighbour search: targets by cubic cells in an ordinary map.
class Neighbours {
 public:
  Neighbours(const TargetSet& targets, double cell_m) : targets_(targets), cell_m_(cell_m) {
    for (size_t i = 0; i < targets.size(); ++i) {
      cells_[CellOf(targets.positions_m[i].cast<double>())].push_back(i);
    }
  }
  // Calls f(index, distance) for targets within cell_m of p.
  template <typename F>
  void Visit(const Eigen::Vector3d& p, F f) const {
    const auto [x, y, z] = CellOf(p);
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dz = -1; dz <= 1; ++dz) {
          const auto cell = cells_.find({x + dx, y + dy, z + dz});
          if (cell == cells_.end()) continue;
          for (size_t i : cell->second) {
            const double distance = (targets_.positions_m[i].cast<double>() - p).norm();
            if (distance <= cell_m_) f(i, distance);
          }
        }
      }
    }
  }

 private:
  using Cell = std::tuple<int, int, int>;
  Cell CellOf(const Eigen::Vector3d& p) const {
    return {static_cast<int>(std::floor(p.x() / cell_m_)),
            static_cast<int>(std::floor(p.y() / cell_m_)),
            static_cast<int>(std::floor(p.z() / cell_m_))};
  }
  const TargetSet& targets_;
  double cell_m_;
  std::map<Cell, std::vector<size_t>> cells_;
};

// Smallest distance of two targets whose normals are within 89 degrees.
double SmallestDistance(const TargetSet& targets, double reach_m) {
  const Neighbours neighbours(targets, reach_m);
  double smallest = reach_m;
  for (size_t i = 0; i < targets.size(); ++i) {
    neighbours.Visit(targets.positions_m[i].cast<double>(), [&](size_t j, double distance) {
      if (j != i && targets.normals[i].dot(targets.normals[j]) > std::cos(89 * 0.0174533)) {
        smallest = std::min(smallest, distance);
      }
    });
  }
  return smallest;
}

// A uniformly random place on the mesh.
struct Place {
  Eigen::Vector3d position, normal;
};
std::vector<Place> RandomPlaces(const TriangleMesh& mesh, int count, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<double> areas;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) areas.push_back(mesh.Area(t));
  std::discrete_distribution<size_t> pick(areas.begin(), areas.end());
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<Place> places;
  for (int i = 0; i < count; ++i) {
    const size_t t = pick(random);
    const double u = std::sqrt(uniform(random)), v = uniform(random);
    places.push_back(
        {(1 - u) * mesh.Corner(t, 0) + u * (1 - v) * mesh.Corner(t, 1) + u * v * mesh.Corner(t, 2),
         mesh.Normal(t)});
  }
  return places;
}

// Largest distance from a place on the surface to the nearest target that faces the same way.
double LargestGap(const TriangleMesh& mesh, const TargetSet& targets, double reach_m, int probes) {
  const Neighbours neighbours(targets, reach_m);
  double largest = 0;
  for (const Place& place : RandomPlaces(mesh, probes, 99)) {
    double nearest = reach_m;
    neighbours.Visit(place.position, [&](size_t i, double distance) {
      if (targets.normals[i].cast<double>().dot(place.normal) > 0) {
        nearest = std::min(nearest, distance);
      }
    });
    largest = std::max(largest, nearest);
  }
  return largest;
}

void ExpectOnSurface(const TriangleMesh& mesh, const TargetSet& targets) {
  ASSERT_EQ(targets.normals.size(), targets.size());
  ASSERT_EQ(targets.triangles.size(), targets.size());
  ASSERT_EQ(targets.regions.size(), targets.size());
  for (size_t i = 0; i < targets.size(); ++i) {
    const uint32_t t = targets.triangles[i];
    ASSERT_LT(t, mesh.triangles.size());
    const Eigen::Vector3d n = mesh.Normal(t), p = targets.positions_m[i].cast<double>();
    ASSERT_NEAR((targets.normals[i].cast<double>() - n).norm(), 0, 1e-6);
    ASSERT_NEAR((p - mesh.Corner(t, 0)).dot(n), 0, 1e-6);
    for (int c = 0; c < 3; ++c) {  // inside each edge
      const Eigen::Vector3d edge = mesh.Corner(t, (c + 1) % 3) - mesh.Corner(t, c);
      ASSERT_GT(n.dot(edge.cross(p - mesh.Corner(t, c))) / edge.norm(), -1e-6);
    }
  }
}

struct Shape {
  const char* name;
  TriangleMesh mesh;
  double spacing_m;
};
std::vector<Shape> Shapes() {
  return {{"box of few large triangles", BoxMesh({0, 0, 0}, {0.3f, 0.2f, 0.05f}), 0.005},
          {"sphere", SphereMesh(0.08, 5), 0.005},
          {"thin wall", BoxMesh({0, 0, 0}, {0.2f, 0.1f, 0.001f}), 0.005},
          {"small triangles", PlateMesh(0.15, 0.1, 300, 200), 0.005},
          {"slivers", PlateMesh(0.2, 0.1, 400, 1), 0.004}};
}

TEST(PoissonDisk, TargetsKeepTheirDistance) {
  for (const Shape& shape : Shapes()) {
    const TargetSet targets = Sample(shape.mesh, Spacing(shape.spacing_m));
    EXPECT_GE(SmallestDistance(targets, 2 * shape.spacing_m), shape.spacing_m * (1 - 1e-6))
        << shape.name;
    ExpectOnSurface(shape.mesh, targets);
  }
}

TEST(PoissonDisk, NoPlaceIsFarFromATarget) {
  for (const Shape& shape : Shapes()) {
    const TargetSet targets = Sample(shape.mesh, Spacing(shape.spacing_m));
    EXPECT_LE(LargestGap(shape.mesh, targets, 2 * shape.spacing_m, 200000), 1.06 * shape.spacing_m)
        << shape.name;
  }
}

// A saturated random packing of equal disks covers 0.547 of the plane: 0.70 targets per spacing^2.
// Less would leave gaps, much more is impossible with the distances kept.
TEST(PoissonDisk, DensityIsThatOfASaturatedPacking) {
  const double side = 0.5, spacing = 0.004;
  const TargetSet targets = Sample(PlateMesh(side, side, 10, 10), Spacing(spacing));
  const double per_spacing2 =
      static_cast<double>(targets.size()) * spacing * spacing / (side * side);
  EXPECT_GT(per_spacing2, 0.68);
  EXPECT_LT(per_spacing2, 0.74);
}

TEST(PoissonDisk, BothSidesOfAThinWallGetTheirTargets) {
  const TargetSet targets = Sample(BoxMesh({0, 0, 0}, {0.2f, 0.2f, 0.001f}), Spacing(0.005));
  int64_t up = 0, down = 0;
  for (const Eigen::Vector3f& n : targets.normals) {
    up += n.z() > 0.9f;
    down += n.z() < -0.9f;
  }
  const double expected = 0.70 * 0.04 / 25e-6;
  EXPECT_NEAR(up, expected, 0.08 * expected);
  EXPECT_NEAR(down, expected, 0.08 * expected);
}

// Radial distribution function on a flat plate: pairs at distance r over those of a Poisson
// process.
TEST(PoissonDisk, RadialDistributionIsThatOfBlueNoise) {
  const double side = 0.5, spacing = 0.004, reach = 6 * spacing;
  const TargetSet targets = Sample(PlateMesh(side, side, 50, 50), Spacing(spacing));
  const Neighbours neighbours(targets, reach);
  constexpr int kBins = 60;
  std::vector<double> pairs(kBins, 0);
  int64_t centres = 0;
  for (size_t i = 0; i < targets.size(); ++i) {
    const Eigen::Vector3d p = targets.positions_m[i].cast<double>();
    // Only centres whose whole neighbourhood is on the plate.
    if (p.head<2>().minCoeff() < reach || p.head<2>().maxCoeff() > side - reach) continue;
    ++centres;
    neighbours.Visit(p, [&](size_t j, double distance) {
      const int bin = static_cast<int>(distance / reach * kBins);
      if (j != i && bin < kBins) pairs[static_cast<size_t>(bin)] += 1;
    });
  }
  ASSERT_GT(centres, 5000);
  // Density of the inner part: targets stand a little denser along a border.
  const double density = static_cast<double>(centres) / std::pow(side - 2 * reach, 2);
  const auto g = [&](int bin) {
    const double inner = reach * bin / kBins, outer = reach * (bin + 1) / kBins;
    return pairs[static_cast<size_t>(bin)] / static_cast<double>(centres) /
           (density * std::numbers::pi * (outer * outer - inner * inner));
  };
  for (int bin = 0; bin < 10; ++bin) EXPECT_EQ(g(bin), 0) << bin;  // below one spacing
  EXPECT_GT(g(10), 1.8);                                           // the peak just beyond it
  double beyond = 0;
  for (int bin = 30; bin < kBins; ++bin) {  // beyond three spacings no order is left
    EXPECT_NEAR(g(bin), 1, 0.06) << bin;
    beyond += g(bin) / (kBins - 30);
  }
  EXPECT_NEAR(beyond, 1, 0.01);
}

// Counts in patches of equal area vary far less than those of independent random points, for which
// the index of dispersion (variance / mean) would be 1, and show no trend across the surface.
TEST(PoissonDisk, EqualAreasGetEqualNumbers) {
  const double radius = 0.1;
  const TriangleMesh sphere = SphereMesh(radius, 6);
  const TargetSet targets = Sample(sphere, Spacing(0.004));
  // Equal z intervals times equal longitudes are equal areas (Archimedes).
  constexpr int kBands = 10, kSectors = 20;
  std::vector<double> counts(kBands * kSectors, 0);
  for (const Eigen::Vector3f& p : targets.positions_m) {
    const int band = std::clamp(static_cast<int>((p.z() / radius + 1) / 2 * kBands), 0, kBands - 1);
    const double longitude = std::atan2(p.y(), p.x()) / (2 * std::numbers::pi) + 0.5;
    const int sector = std::clamp(static_cast<int>(longitude * kSectors), 0, kSectors - 1);
    counts[static_cast<size_t>(band * kSectors + sector)] += 1;
  }
  const double mean = static_cast<double>(targets.size()) / static_cast<double>(counts.size());
  double chi2 = 0;
  for (double count : counts) chi2 += (count - mean) * (count - mean) / mean;
  const double dispersion = chi2 / static_cast<double>(counts.size() - 1);
  EXPECT_GT(mean, 20);
  EXPECT_LT(dispersion, 0.35);  // for 199 degrees of freedom, 1 +- 0.1 if they were independent
}

// The same plate in large and in small triangles gets the same density everywhere.
TEST(PoissonDisk, DensityDoesNotDependOnTheTriangulation) {
  TriangleMesh plate = Merged(PlateMesh(0.2, 0.2, 2, 2), PlateMesh(0.2, 0.2, 200, 200));
  for (size_t i = 9; i < plate.positions_m.size(); ++i) plate.positions_m[i].x() += 0.3f;
  const TargetSet targets = Sample(plate, Spacing(0.003));
  double left = 0, right = 0;
  for (const Eigen::Vector3f& p : targets.positions_m) (p.x() < 0.25f ? left : right) += 1;
  EXPECT_NEAR(left / right, 1, 0.02);
}

TEST(PoissonDisk, RegionsHaveTheirOwnSpacing) {
  const TriangleMesh plate = PlateMesh(0.4, 0.2, 8, 4);
  TargetSampling sampling = Spacing(0.008);
  sampling.regions = {{"fine", {0.2, -1, -1}, {1, 1, 1}, 0.002},
                      {"coarse", {-1, -1, -1}, {0.1, 1, 1}, 0.016}};
  const TargetSet targets = Sample(plate, sampling);
  std::map<int, double> counts;
  for (size_t i = 0; i < targets.size(); ++i) {
    counts[targets.regions[i]] += 1;
    const float x = targets.positions_m[i].x();
    EXPECT_EQ(targets.regions[i], x >= 0.2f ? 0 : x <= 0.1f ? 1 : -1);
  }
  // Density goes with 1 / spacing^2; the borders blur it where there are few targets.
  const double fine = counts[0] / (0.2 * 0.2), middle = counts[-1] / (0.1 * 0.2),
               coarse = counts[1] / (0.1 * 0.2);
  EXPECT_NEAR(fine / middle, 16, 2);
  EXPECT_NEAR(middle / coarse, 4, 1);
  EXPECT_NEAR(fine * 0.002 * 0.002, 0.71, 0.03);

  // Within a class the class's spacing holds; between classes the smaller one.
  const Neighbours neighbours(targets, 0.016);
  const auto spacing_of = [&](size_t i) {
    return targets.regions[i] == 0 ? 0.002 : targets.regions[i] == 1 ? 0.016 : 0.008;
  };
  for (size_t i = 0; i < targets.size(); ++i) {
    neighbours.Visit(targets.positions_m[i].cast<double>(), [&](size_t j, double distance) {
      if (i != j) {
        EXPECT_GE(distance, std::min(spacing_of(i), spacing_of(j)) * (1 - 1e-5));
      }
    });
  }
  // No gaps: every place has a target within about its own spacing.
  for (const Place& place : RandomPlaces(plate, 50000, 3)) {
    const double own = place.position.x() >= 0.2   ? 0.002
                       : place.position.x() <= 0.1 ? 0.016
                                                   : 0.008;
    double nearest = 1;
    const Neighbours& all = neighbours;
    all.Visit(place.position, [&](size_t, double d) { nearest = std::min(nearest, d); });
    ASSERT_LE(nearest, 1.06 * own) << place.position.transpose();
  }
}

TEST(PoissonDisk, OfOverlappingRegionsTheDenserCounts) {
  TargetSampling sampling = Spacing(0.01);
  sampling.regions = {{"outer", {0, 0, -1}, {0.1, 0.1, 1}, 0.005},
                      {"inner", {0.04, 0.04, -1}, {0.06, 0.06, 1}, 0.001}};
  const TargetSet targets = Sample(PlateMesh(0.1, 0.1, 1, 1), sampling);
  int64_t inner = 0;
  for (int32_t region : targets.regions) {
    EXPECT_GE(region, 0);
    inner += region == 1;
  }
  EXPECT_NEAR(static_cast<double>(inner), 0.7 * 0.0004 / 1e-6, 60);
}

// A small dense region on two large triangles: as many targets as its area asks for, and quickly.
TEST(PoissonDisk, SmallDenseRegionOnALargeTriangle) {
  TargetSampling sampling = Spacing(0.02);
  sampling.regions = {{"bore", {0.5, 0.5, -1}, {0.51, 0.51, 1}, 0.0002}};
  const TargetSet targets = Sample(PlateMesh(2, 2, 1, 1), sampling);
  int64_t dense = 0;
  for (int32_t region : targets.regions) dense += region == 0;
  EXPECT_NEAR(static_cast<double>(dense), 0.7 * 1e-4 / 4e-8, 100);
  EXPECT_NEAR(static_cast<double>(targets.size()) - static_cast<double>(dense), 0.7 * 4 / 4e-4,
              0.06 * 7000);
}

TEST(PoissonDisk, SameSeedSameTargetsOtherSeedOthers) {
  const TriangleMesh mesh = SphereMesh(0.05, 4);
  const TargetSet a = Sample(mesh, Spacing(0.005, 7)), b = Sample(mesh, Spacing(0.005, 7)),
                  c = Sample(mesh, Spacing(0.005, 8));
  EXPECT_EQ(a.positions_m, b.positions_m);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_NE(a.positions_m, c.positions_m);
  EXPECT_NEAR(static_cast<double>(a.size()), static_cast<double>(c.size()), 0.05 * a.size());
}

// Neighbours in the list are neighbours on the part: far nearer than the part is large.
TEST(PoissonDisk, TargetsAreSortedForLocality) {
  const TargetSet targets = Sample(SphereMesh(0.1, 5), Spacing(0.004));
  double sum = 0;
  for (size_t i = 1; i < targets.size(); ++i) {
    sum += (targets.positions_m[i] - targets.positions_m[i - 1]).norm();
  }
  EXPECT_LT(sum / static_cast<double>(targets.size() - 1), 3 * 0.004);
}

TEST(PoissonDisk, NothingToSampleOrTooMuchIsAnError) {
  EXPECT_EQ(SampleTargets(TriangleMesh(), Spacing(0.005)).status().code(),
            absl::StatusCode::kInvalidArgument);
  TriangleMesh line;
  line.positions_m = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  line.triangles = {{0, 1, 2}};
  EXPECT_EQ(SampleTargets(line, Spacing(0.005)).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(SampleTargets(BoxMesh({0, 0, 0}, {10, 10, 10}), Spacing(0.0001)).status().code(),
            absl::StatusCode::kResourceExhausted);
}

// At any moment, and without having made anything of it.
TEST(PoissonDisk, StopsSoonWhenItIsCancelled) {
  const TriangleMesh box = BoxMesh({0, 0, 0}, {0.3, 0.3, 0.3});
  for (const int after_ms : {0, 100, 400}) {
    std::atomic<bool> cancelled = false;
    double asked_s = 0;
    std::thread canceller([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(after_ms));
      // The flag first: this thread may have to wait between the two while the work goes on.
      cancelled = true;
      asked_s = CpuSeconds();
    });
    const absl::Status status = SampleTargets(box, Spacing(0.0007), &cancelled).status();
    const double ended_s = CpuSeconds();
    canceller.join();
    EXPECT_EQ(status.code(), absl::StatusCode::kCancelled) << status;
    EXPECT_LT(ended_s - asked_s, 0.5 * kSlowness) << "cancelled after " << after_ms << " ms";
  }
}

TEST(PoissonDisk, PartSmallerThanTheSpacingStillGetsTargets) {
  // One per side of the box, since their normals differ by 90 degrees or more.
  EXPECT_EQ(Sample(BoxMesh({0, 0, 0}, {0.002f, 0.002f, 0.002f}), Spacing(0.1)).size(), 6u);
}

TEST(PoissonDisk, DegenerateTrianglesGetNoTargets) {
  TriangleMesh mesh = BoxMesh({0, 0, 0}, {0.1f, 0.1f, 0.1f});
  mesh.triangles.push_back({0, 0, 1});
  mesh.triangles.push_back({0, 1, 1});
  for (uint32_t t : Sample(mesh, Spacing(0.005)).triangles) EXPECT_LT(t, 12u);
}

}  // namespace
}  // namespace sightline
