// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/explanation/aimed_scan.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

// Largest distance of a wanted position from the image's centre, as a fraction of the half image.
constexpr double kMostOffCentre = 0.8;

size_t Cell(double u, size_t cells) {
  return std::min(cells - 1, static_cast<size_t>(u * static_cast<double>(cells)));
}

// Value at position u in [0, 1] of a domain; its ranges are concatenated.
double ValueAt(const ParameterDomain& domain, double u) {
  if (domain.ranges.empty()) return domain.values[Cell(u, domain.values.size())];
  double length = 0;
  for (const auto& range : domain.ranges) length += range.max - range.min;
  if (length <= 0) return domain.ranges[Cell(u, domain.ranges.size())].min;
  double rest = u * length;
  for (const auto& range : domain.ranges) {
    if (rest <= range.max - range.min) return range.min + rest;
    rest -= range.max - range.min;
  }
  return domain.ranges.back().max;
}

double NearestValue(const ParameterDomain& domain, double wanted) {
  double nearest = wanted, distance = std::numeric_limits<double>::infinity();
  const auto consider = [&](double value) {
    if (std::abs(value - wanted) >= distance) return;
    distance = std::abs(value - wanted);
    nearest = value;
  };
  for (const double value : domain.values) consider(value);
  for (const auto& range : domain.ranges) consider(std::clamp(wanted, range.min, range.max));
  return nearest;
}

// Maps [0, 1] to [-1, 1], denser near 0.
double Centred(double u) { return std::pow(2 * u - 1, 3); }

}  // namespace

Aim SpreadAim(int index) {
  // The real root of x^10 = x + 1, by which the recurrence is known to spread in nine dimensions.
  static const double ratio = [] {
    double x = 1;
    for (int i = 0; i < 100; ++i) x = std::pow(1 + x, 1.0 / (kAimDimensions + 1));
    return x;
  }();
  Aim aim;
  for (int k = 0; k < kAimDimensions; ++k) {
    const double place = 0.5 + (index + 1) * std::pow(ratio, -(k + 1));
    aim[k] = place - std::floor(place);
  }
  return aim;
}

AimedScan MakeAimedScan(const Rig& rig, const MeasurementDomain& domain, const Aim& aim) {
  std::array<double, kMeasurementParameters> values{};
  for (int i = kCameraDistance; i <= kPartGamma; ++i) {
    values[i] = ValueAt(domain.parameters[i], aim[i]);
  }
  if (!domain.resting_orientations.empty()) {
    const RestingOrientation& resting =
        domain.resting_orientations[Cell(aim[kPartAlpha], domain.resting_orientations.size())];
    values[kPartAlpha] = resting.part_alpha_rad;
    values[kPartBeta] = resting.part_beta_rad;
  }
  AimedScan scan;
  scan.measurement = FromArray(values);
  scan.geometry = MakeScanGeometry(rig, scan.measurement);
  const double distance_m = scan.measurement.camera_distance_m;
  const double focal_px = rig.camera.FocalLengthPx();
  const double half_width_m = 0.5 * rig.camera.columns_px / focal_px * distance_m;
  // Along the sheet the image covers more, the smaller the angle; half the distance is far enough.
  const double half_height_m =
      std::min(0.5 * distance_m, 0.5 * rig.camera.rows_px / focal_px * distance_m /
                                     std::abs(std::sin(scan.measurement.triangulation_angle_rad)));
  scan.wanted_m =
      kMostOffCentre * (Centred(aim[kOffsetY]) * half_width_m * scan.geometry.laser.x_axis +
                        Centred(aim[kOffsetZ]) * half_height_m * scan.geometry.laser.z_axis);
  return scan;
}

ScanOfPlace AimAt(const AimedScan& scan, const MeasurementDomain& domain,
                  const Eigen::Vector3d& part_centre_m, const Eigen::Vector3d& place_m) {
  const ScanGeometry& geometry = scan.geometry;
  Eigen::Vector3d at = geometry.part_rotation * (place_m - part_centre_m);
  ScanOfPlace result;
  result.measurement = scan.measurement;
  result.measurement.offset_y_m =
      NearestValue(domain.parameters[kOffsetY], scan.wanted_m.y() - at.y());
  result.measurement.offset_z_m =
      NearestValue(domain.parameters[kOffsetZ], scan.wanted_m.z() - at.z());
  at.y() += result.measurement.offset_y_m;
  at.z() += result.measurement.offset_z_m;
  result.stage_m = geometry.LitStagePosition(at);
  at.x() += result.stage_m;
  result.to_camera_m = geometry.camera.origin_m - at;
  result.to_laser_m = geometry.laser.origin_m - at;
  return result;
}

}  // namespace sightline
