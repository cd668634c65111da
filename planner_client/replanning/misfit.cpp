// SPDX-License-Identifier: Apache-2.0
#include "planner_client/replanning/misfit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/rig/scan_geometry.h"
#include "core/statistics/order_statistics.h"
#include "core/triangulation/triangulation.h"

namespace sightline {
namespace {

constexpr size_t kSample = 2000;

std::vector<Eigen::Vector3d> EvenSample(std::span<const Eigen::Vector3d> points, size_t most) {
  std::vector<Eigen::Vector3d> sample;
  const size_t step = points.size() / most + 1;
  for (size_t i = 0; i < points.size(); i += step) sample.push_back(points[i]);
  return sample;
}

double MedianDistance(const SurfaceIndex& model, std::span<const Eigen::Vector3d> points_m,
                      double reach_m) {
  std::vector<double> distances_m;
  for (const Eigen::Vector3d& point : points_m) {
    const auto on = model.Nearest(point, Eigen::Vector3d::Zero(), reach_m);
    distances_m.push_back(on ? on->distance_m : std::numeric_limits<double>::infinity());
  }
  return UpperMedian(std::move(distances_m));
}

double SizeOf(std::span<const Eigen::Vector3d> points_m) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : points_m) box.extend(point);
  return box.sizes().norm();
}

std::string OtherUnit(const SurfaceIndex& model, std::span<const Eigen::Vector3d> sample) {
  struct Unit {
    const char* option;
    const char* name;
    double metres;
  };
  constexpr std::array<Unit, 4> kUnits = {{{"mm", "millimetres", 1e-3},
                                           {"inch", "inches", 0.0254},
                                           {"cm", "centimetres", 1e-2},
                                           {"um", "micrometres", 1e-6}}};
  const double model_m = model.mesh().BoundingBox().sizes().norm(), size = SizeOf(sample);
  for (const Unit& unit : kUnits) {
    const double size_m = unit.metres * size;
    if (size_m < 0.2 * model_m || size_m > 1.5 * model_m) continue;
    std::vector<Eigen::Vector3d> scaled;
    for (const Eigen::Vector3d& point : sample) scaled.push_back(unit.metres * point);
    if (MedianDistance(model, scaled, model_m) > 0.05 * model_m) continue;
    return absl::StrCat("They fit the part in ", unit.name, ": give --measured-unit ", unit.option);
  }
  return "";
}

// Robust residuals alone are not sufficient: if most faces lie on their own mirror images, most
// points of a mirrored part fit.
bool IsFarBetter(const Misfit& before, const Misfit& after) {
  constexpr double kBetter = 3;
  return after.residual_m < before.residual_m / kBetter ||
         (before.fraction_off > kSuspiciousFractionOff &&
          after.fraction_off < before.fraction_off / kBetter);
}

// Reflected in the plane across `axis` through `place_m`.
std::vector<Eigen::Vector3d> Mirrored(std::span<const Eigen::Vector3d> points_m, int axis,
                                      double place_m) {
  std::vector<Eigen::Vector3d> mirrored(points_m.begin(), points_m.end());
  for (Eigen::Vector3d& point : mirrored) point[axis] = 2 * place_m - point[axis];
  return mirrored;
}

std::string MirrorImage(const SurfaceIndex& model, std::span<const Eigen::Vector3d> sample,
                        const PosePrior& prior, const Misfit& misfit) {
  const Eigen::AlignedBox3d box = model.mesh().BoundingBox();
  RegistrationOptions options;
  options.prior = prior;
  options.correlation_length_m = box.sizes().norm() / 40;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double place_m : {0.0, box.center()[axis]}) {
      const auto mirrored = Mirrored(sample, axis, place_m);
      if (MedianDistance(model, mirrored, options.reach_m) > options.reach_m) continue;
      const auto found = RegisterPoints(model, mirrored, {}, options);
      if (!found.ok() || !found->converged ||
          found->points < static_cast<int64_t>(9 * sample.size() / 10) ||
          !IsFarBetter(misfit, {.residual_m = found->residual_standard_deviation_m,
                                .fraction_off = FractionOff(model, mirrored, found->pose)})) {
        continue;
      }
      return absl::StrCat("They fit the part if they are mirrored in ", std::string(1, "xyz"[axis]),
                          ": is an axis of the scanner reversed?");
    }
  }
  return "";
}

bool InView(const Rig& rig, const ScanGeometry& geometry, const Eigen::Vector3d& part_centre_m,
            const Eigen::Vector3d& position_m, const Eigen::Vector3d& normal) {
  const double stage_m =
      geometry.LitStagePosition(PartToWorld(geometry, part_centre_m, position_m, 0));
  if (!std::isfinite(stage_m)) return false;
  const TriangulationSetup setup = MakeTriangulationSetup(
      rig.camera, WorldToPart(geometry, part_centre_m, geometry.camera, stage_m),
      WorldToPart(geometry, part_centre_m, geometry.laser, stage_m));
  const Eigen::Vector3d to_camera = setup.camera.origin_m - position_m;
  if (to_camera.dot(setup.camera.z_axis) >= 0 || normal.dot(to_camera) <= 0) return false;
  if (normal.dot(setup.laser.origin_m - position_m) <= 0) return false;
  const Eigen::Vector2d image_px = ProjectPoint(setup, position_m);
  return image_px.x() >= 0 && image_px.y() >= 0 && image_px.x() <= rig.camera.columns_px &&
         image_px.y() <= rig.camera.rows_px;
}

}  // namespace

double FractionOff(const SurfaceIndex& model, std::span<const Eigen::Vector3d> points_m,
                   const PartPose& pose) {
  constexpr double kOff_m = 1e-3;
  const Eigen::Isometry3d to_model = pose.Matrix().inverse();
  const std::vector<Eigen::Vector3d> sample = EvenSample(points_m, kSample);
  size_t off = 0;
  for (const Eigen::Vector3d& point : sample) {
    off += !model.Nearest(to_model * point, Eigen::Vector3d::Zero(), kOff_m);
  }
  return sample.empty() ? 0 : static_cast<double>(off) / static_cast<double>(sample.size());
}

std::string LikelyMisfit(const SurfaceIndex& model, std::span<const Eigen::Vector3d> points_m,
                         const PosePrior& prior, const Misfit& misfit) {
  const std::vector<Eigen::Vector3d> sample = EvenSample(points_m, kSample);
  std::string reason = OtherUnit(model, sample);
  if (reason.empty()) reason = MirrorImage(model, sample, prior, misfit);
  return reason;
}

double FractionInView(const Rig& rig, const Measurement& scan, const Eigen::Vector3d& part_centre_m,
                      std::span<const Eigen::Vector3f> positions_m,
                      std::span<const Eigen::Vector3f> normals) {
  const ScanGeometry geometry = MakeScanGeometry(rig, scan);
  const size_t step = positions_m.size() / 500 + 1;
  size_t seen = 0, all = 0;
  for (size_t i = 0; i < positions_m.size(); i += step) {
    ++all;
    seen += InView(rig, geometry, part_centre_m, positions_m[i].cast<double>(),
                   normals[i].cast<double>());
  }
  return all == 0 ? 1 : static_cast<double>(seen) / static_cast<double>(all);
}

std::optional<size_t> OtherScanInView(const Rig& rig, std::span<const Measurement> scans,
                                      size_t own, const Eigen::Vector3d& part_centre_m,
                                      std::span<const Eigen::Vector3f> positions_m,
                                      std::span<const Eigen::Vector3f> normals) {
  if (FractionInView(rig, scans[own], part_centre_m, positions_m, normals) >= 0.5) {
    return std::nullopt;
  }
  std::optional<size_t> best;
  double most = 0.9;
  for (size_t s = 0; s < scans.size(); ++s) {
    if (s == own) continue;
    const double seen = FractionInView(rig, scans[s], part_centre_m, positions_m, normals);
    if (seen < most || (best && seen == most)) continue;
    most = seen;
    best = s;
  }
  return best;
}

}  // namespace sightline
