// SPDX-License-Identifier: Apache-2.0
#include "planner_client/acceptance/artefact_mesh.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <numbers>

namespace sightline {
namespace {

using Eigen::Vector3d;

static_assert(std::endian::native == std::endian::little, "binary STL is little-endian");

constexpr int kFacetsAround = 720;
constexpr double kCap_rad = 88 * std::numbers::pi / 180;
constexpr int kFacetsOfCap = 176;
constexpr int kFacetsOfBore = 8;

template <typename T>
void Append(T value, std::string* bytes) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes->append(raw, sizeof(T));
}

// Triangles of binary STL.
class Triangles {
 public:
  void Add(const std::array<Vector3d, 3>& corners) {
    const Vector3d across = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (!(across.norm() > 0)) return;  // at the pole of a sphere
    AddVector(across.normalized());
    for (const Vector3d& corner : corners) {
      AddVector(corner);
      box_m_.extend(corner);
    }
    Append<uint16_t>(0, &bytes_);
    ++count_;
  }
  // Triangles of a grid of places (i, j), two a cell.
  void AddGrid(int columns, int rows, const std::function<Vector3d(int, int)>& place) {
    for (int i = 0; i < columns; ++i) {
      for (int j = 0; j < rows; ++j) {
        const Vector3d a = place(i, j), b = place(i + 1, j), c = place(i + 1, j + 1),
                       d = place(i, j + 1);
        Add({a, b, c});
        Add({a, c, d});
      }
    }
  }
  ArtefactMesh Finish() const {
    std::string stl(80, ' ');
    Append<uint32_t>(count_, &stl);
    return {stl + bytes_, box_m_};
  }

 private:
  void AddVector(const Vector3d& v) {
    for (int k = 0; k < 3; ++k) Append(static_cast<float>(v[k]), &bytes_);
  }

  std::string bytes_;
  uint32_t count_ = 0;
  Eigen::AlignedBox3d box_m_;
};

void AddSphere(const ArtefactSurface& s, Triangles* triangles) {
  const Vector3d pole = (s.reference_m - s.nominal.point_m).normalized();
  const Vector3d u = pole.unitOrthogonal(), v = pole.cross(u);
  triangles->AddGrid(kFacetsOfCap, kFacetsAround, [&](int i, int j) {
    const double down = kCap_rad * i / kFacetsOfCap;
    const double turn = 2 * std::numbers::pi * (j % kFacetsAround) / kFacetsAround;
    return Vector3d(
        s.nominal.point_m +
        s.nominal.radius_m *
            (std::cos(down) * pole + std::sin(down) * (std::cos(turn) * u + std::sin(turn) * v)));
  });
}

void AddBore(const ArtefactSurface& s, Triangles* triangles) {
  const Vector3d u = s.nominal.axis.unitOrthogonal(), v = s.nominal.axis.cross(u);
  triangles->AddGrid(kFacetsOfBore, kFacetsAround, [&](int i, int j) {
    const double along = s.half_length_m * (2.0 * i / kFacetsOfBore - 1);
    const double turn = 2 * std::numbers::pi * (j % kFacetsAround) / kFacetsAround;
    return Vector3d(s.nominal.point_m + along * s.nominal.axis +
                    s.nominal.radius_m * (std::cos(turn) * u + std::sin(turn) * v));
  });
}

void AddPlate(const ArtefactSurface& s, Triangles* triangles) {
  triangles->AddGrid(1, 1, [&](int i, int j) {
    return Vector3d(s.nominal.point_m + s.half_side_m * (2.0 * i - 1) * s.side_x +
                    s.half_side_m * (2.0 * j - 1) * s.side_y);
  });
}

}  // namespace

ArtefactMesh MeshOfArtefact(const Artefact& artefact) {
  Triangles triangles;
  for (const ArtefactSurface& surface : artefact.surfaces) {
    switch (surface.nominal.kind) {
      case SurfaceKind::kSphere:
        AddSphere(surface, &triangles);
        break;
      case SurfaceKind::kCylinder:
        AddBore(surface, &triangles);
        break;
      default:
        AddPlate(surface, &triangles);
    }
  }
  return triangles.Finish();
}

}  // namespace sightline
