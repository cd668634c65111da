// SPDX-License-Identifier: Apache-2.0
#include "report/uncertainty/uncertainty_ply.h"

#include <Eigen/Eigenvalues>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// The report's colours of classes (viewer/report.css, light page).
constexpr std::array<std::array<uint8_t, 3>, kUncertaintyClasses> kClassColours = {
    {{0x21, 0x76, 0xae},
     {0xf2, 0xc1, 0x4e},
     {0xb8, 0x32, 0x1f},
     {0xd9, 0xd3, 0xe3},
     {0x8d, 0x92, 0x98}}};

void AppendWord(std::string* bytes, uint32_t word) {
  for (int shift = 0; shift < 32; shift += 8) *bytes += static_cast<char>((word >> shift) & 0xffu);
}

void AppendFloat(std::string* bytes, double value) {
  AppendWord(bytes, std::bit_cast<uint32_t>(static_cast<float>(value)));
}

// Unit sphere: an octahedron whose edges are halved once. 18 corners, 32 triangles.
struct Sphere {
  std::vector<Eigen::Vector3d> corners;
  std::vector<std::array<uint32_t, 3>> triangles;
};

Sphere MakeSphere() {
  Sphere sphere;
  for (int axis = 0; axis < 3; ++axis) {
    sphere.corners.emplace_back(Eigen::Vector3d::Unit(axis));
    sphere.corners.emplace_back(-Eigen::Vector3d::Unit(axis));
  }
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
  const auto middle = [&](uint32_t a, uint32_t b) {
    const auto [entry, is_new] =
        middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(sphere.corners.size()));
    if (is_new) {
      const Eigen::Vector3d sum = sphere.corners[a] + sphere.corners[b];
      sphere.corners.push_back(sum.normalized());
    }
    return entry->second;
  };
  for (uint32_t octant = 0; octant < 8; ++octant) {
    const uint32_t x = octant & 1u, y = 2 + ((octant >> 1) & 1u), z = 4 + ((octant >> 2) & 1u);
    // Mirrored octants are turned round, so that all triangles face outward.
    const bool mirrored = std::popcount(octant) % 2 == 1;
    const std::array<uint32_t, 3> t =
        mirrored ? std::array<uint32_t, 3>{x, z, y} : std::array<uint32_t, 3>{x, y, z};
    const uint32_t m01 = middle(t[0], t[1]), m12 = middle(t[1], t[2]), m20 = middle(t[2], t[0]);
    sphere.triangles.push_back({t[0], m01, m20});
    sphere.triangles.push_back({m01, t[1], m12});
    sphere.triangles.push_back({m20, m12, t[2]});
    sphere.triangles.push_back({m01, m12, m20});
  }
  return sphere;
}

}  // namespace

absl::StatusOr<std::string> UncertaintyPly(const TargetSet& targets,
                                           const TargetUncertainties& uncertainties,
                                           const TargetBits& measurable) {
  const size_t count = targets.size();
  for (const auto& [field, size] :
       {std::pair{"normals", targets.normals.size()}, std::pair{"measurable", measurable.size()}}) {
    if (size == count) continue;
    return absl::InvalidArgumentError(absl::StrFormat(
        "uncertainty PLY: %s has size %d, must be %d (number of targets)", field, size, count));
  }
  // Scans and features do not come into the file.
  SIGHTLINE_RETURN_IF_ERROR(
      CheckTargetUncertainties(uncertainties, count, uncertainties.scan_sensitivities.size(),
                               uncertainties.feature_targets.size(), "uncertainty PLY"));
  std::string bytes = absl::StrCat(
      "ply\nformat binary_little_endian 1.0\ncomment lengths in metres, part coordinates\n"
      "comment standard uncertainty along the normal and its parts; admissible_m 0: not "
      "toleranced\n"
      "comment class 0 admissible, 1 relaxed, 2 not reached, 3 not toleranced, 4 not measurable\n"
      "element vertex ",
      count, "\n");
  for (const char* property :
       {"float x", "float y", "float z", "float nx", "float ny", "float nz", "uchar red",
        "uchar green", "uchar blue", "float uncertainty_m", "float noise_m", "float sampling_m",
        "float calibration_m", "float registration_m", "float admissible_m", "uchar class"}) {
    absl::StrAppend(&bytes, "property ", property, "\n");
  }
  bytes += "end_header\n";
  bytes.reserve(bytes.size() + 52 * count);
  for (size_t i = 0; i < count; ++i) {
    for (const Eigen::Vector3f& v : {targets.positions_m[i], targets.normals[i]}) {
      for (int axis = 0; axis < 3; ++axis) AppendFloat(&bytes, v[axis]);
    }
    const auto kind = static_cast<uint8_t>(ClassOfTarget(uncertainties, measurable, i));
    for (const uint8_t channel : kClassColours[kind]) bytes += static_cast<char>(channel);
    AppendFloat(&bytes, uncertainties.total_m[i]);
    AppendFloat(&bytes, uncertainties.noise_m[i]);
    AppendFloat(&bytes, uncertainties.sampling_m[i]);
    AppendFloat(&bytes, uncertainties.calibration_m[i]);
    AppendFloat(&bytes, uncertainties.registration_m.empty() ? 0 : uncertainties.registration_m[i]);
    AppendFloat(&bytes, uncertainties.admissible_m[i]);
    bytes += static_cast<char>(kind);
  }
  return bytes;
}

absl::StatusOr<std::string> CovarianceEllipsoidsPly(std::span<const CovarianceEllipsoid> ellipsoids,
                                                    double scale) {
  if (ellipsoids.size() > kMostEllipsoids) {
    return absl::InvalidArgumentError(absl::StrFormat("ellipsoids: there are %d, at most %d fit",
                                                      ellipsoids.size(), kMostEllipsoids));
  }
  if (!(scale > 0 && scale <= 1e6)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("ellipsoids: scale is %g, must be in (0, 1e6]", scale));
  }
  const Sphere sphere = MakeSphere();
  std::string bytes = absl::StrFormat(
      "ply\nformat binary_little_endian 1.0\ncomment lengths in metres, part coordinates\n"
      "comment surfaces at %.9g standard deviations; largest_m: one standard deviation\n"
      "element vertex %d\nproperty float x\nproperty float y\nproperty float z\n"
      "property float largest_m\nelement face %d\n"
      "property list uchar int vertex_indices\nend_header\n",
      scale, ellipsoids.size() * sphere.corners.size(),
      ellipsoids.size() * sphere.triangles.size());
  for (size_t i = 0; i < ellipsoids.size(); ++i) {
    const Eigen::Matrix3d& covariance = ellipsoids[i].covariance_m2;
    const auto refuse = [i](absl::string_view why) {
      return absl::InvalidArgumentError(absl::StrCat("ellipsoids[", i, "]", why));
    };
    if (!ellipsoids[i].centre_m.allFinite()) return refuse(".centre_m is not finite");
    if (!covariance.allFinite()) return refuse(".covariance_m2 is not finite");
    const double size_m2 = covariance.cwiseAbs().maxCoeff();
    if ((covariance - covariance.transpose()).cwiseAbs().maxCoeff() > 1e-9 * size_m2)
      return refuse(".covariance_m2 is not symmetric");
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);
    // Rounding may leave a variance of zero slightly below it.
    if (axes.eigenvalues()[0] < -1e-9 * size_m2)
      return refuse(".covariance_m2 has a negative variance");
    const Eigen::Vector3d deviations_m = axes.eigenvalues().cwiseMax(0).cwiseSqrt();
    const Eigen::Matrix3d root =
        axes.eigenvectors() * deviations_m.asDiagonal() * axes.eigenvectors().transpose();
    for (const Eigen::Vector3d& corner : sphere.corners) {
      const Eigen::Vector3d place = ellipsoids[i].centre_m + scale * (root * corner);
      for (int axis = 0; axis < 3; ++axis) AppendFloat(&bytes, place[axis]);
      AppendFloat(&bytes, deviations_m[2]);
    }
  }
  for (size_t i = 0; i < ellipsoids.size(); ++i) {
    const auto first = static_cast<uint32_t>(i * sphere.corners.size());
    for (const auto& triangle : sphere.triangles) {
      bytes += '\3';
      for (const uint32_t corner : triangle) AppendWord(&bytes, first + corner);
    }
  }
  return bytes;
}

}  // namespace sightline
