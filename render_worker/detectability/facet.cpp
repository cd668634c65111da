// SPDX-License-Identifier: Apache-2.0
#include "render_worker/detectability/facet.h"

#include <algorithm>
#include <cmath>

#include "core/rig/scan_geometry.h"

namespace sightline {
namespace {

// Columns of the region: two blocks of the evaluation, one where the line is steep.
constexpr int kColumns_px = 64, kFewestColumns_px = 32;
// Rows beside the line, and at most.
constexpr int kRowsBeside_px = 32, kMostRows_px = 256;

}  // namespace

TriangleMesh FacetMesh(double half_edge_m) {
  const auto h = static_cast<float>(half_edge_m);
  TriangleMesh mesh;
  mesh.positions_m = {{-h, -h, 0}, {h, -h, 0}, {h, h, 0}, {-h, h, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

Measurement MeasurementOf(const FacetView& view) {
  const double cc = std::cos(view.camera_incidence_rad), sc = std::sin(view.camera_incidence_rad);
  const double cl = std::cos(view.laser_incidence_rad), sl = std::sin(view.laser_incidence_rad);
  // Spherical law of cosines in the triangle of normal, camera and laser.
  const double between =
      std::acos(std::clamp(cc * cl + sc * sl * std::cos(view.azimuth_rad), -1.0, 1.0));
  // With the camera along +z and the laser at (-sin between, 0, cos between), the normal has the
  // azimuth with which it makes its angle with the laser.
  const double sines = std::sin(between) * sc;
  const double turn =
      sines > 1e-12 ? std::acos(std::clamp((std::cos(between) * cc - cl) / sines, -1.0, 1.0)) : 0;
  Measurement measurement;
  measurement.camera_distance_m = view.camera_distance_m;
  measurement.triangulation_angle_rad = between;
  measurement.camera_azimuth_rad = 0;
  measurement.camera_polar_rad = 0;
  // R_z(gamma) R_y(beta) turns z into (sin beta cos gamma, sin beta sin gamma, cos beta).
  measurement.part_beta_rad = view.camera_incidence_rad;
  measurement.part_gamma_rad = turn;
  return measurement;
}

RegionOfInterest RegionAboutLine(const Rig& rig, const Measurement& measurement) {
  const ScanGeometry geometry = MakeScanGeometry(rig, measurement);
  const Eigen::Vector3d line = geometry.part_rotation.col(2).cross(geometry.sheet_normal);
  const double along = std::abs(line.dot(geometry.camera.x_axis)),
               across = std::abs(line.dot(geometry.camera.y_axis));
  const double slope = across / std::max(along, 1e-9);
  RegionOfInterest region;
  region.columns_px = slope < 1 ? kColumns_px : kFewestColumns_px;
  const double rows =
      std::min<double>(kMostRows_px, 2 * kRowsBeside_px + slope * region.columns_px);
  region.rows_px = 4 * static_cast<int>(std::ceil(rows / 4));
  region.columns_px = std::min(region.columns_px, rig.camera.columns_px / 4 * 4);
  region.rows_px = std::min(region.rows_px, rig.camera.rows_px / 4 * 4);
  region.column_px = -region.columns_px / 2;
  region.row_px = -region.rows_px / 2;
  return region;
}

}  // namespace sightline
