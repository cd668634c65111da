// SPDX-License-Identifier: Apache-2.0
#include "planning/requirements/reach.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "core/random/random.h"
#include "core/rig/scan_geometry.h"
#include "core/status/status_macros.h"
#include "core/surface_inference/surface_inference.h"
#include "core/triangulation/triangulation.h"
#include "planning/optimise/search_space.h"

namespace sightline {

double BestInformationDensity(const Rig& rig, const UncertaintyModel& model,
                              const MeasurementDomain& domain) {
  constexpr int kScans = 4096;
  constexpr int kTilts = 8;  // of the surface between camera and laser
  const SearchSpace space(domain);
  Random random(DeriveSeed(1, 29));
  double best = 0;
  for (int i = 0; i < kScans; ++i) {
    std::vector<double> x(static_cast<size_t>(space.dimension()));
    for (double& coordinate : x) coordinate = random.Uniform();
    const ScanGeometry g = MakeScanGeometry(rig, space.ToMeasurement(x));
    // A sheet nearly along the scan direction gives arbitrarily dense frames, but travels more than
    // ten times the length that it covers.
    if (std::abs(g.sheet_normal.x()) < 0.1) continue;
    const double advance = std::abs(g.sheet_normal.x()) * rig.scan_step_m;
    const Eigen::Vector3d to_camera = g.camera.origin_m.normalized(),
                          to_laser = g.laser.origin_m.normalized();
    const double depth_m = g.camera.origin_m.norm();
    const double scale = depth_m / rig.camera.FocalLengthPx();  // size of a pixel at the origin [m]
    for (int k = 0; k <= kTilts; ++k) {
      const double share = static_cast<double>(k) / kTilts;
      const Eigen::Vector3d normal = ((1 - share) * to_camera + share * to_laser).normalized();
      const double columns_per_length =
          std::abs(g.sheet_normal.cross(normal).dot(g.camera.x_axis)) / scale;
      const Eigen::Vector2d by_image = ImageDerivativesAlong(
          normal, g.camera, rig.camera.FocalLengthPx(), g.sheet_normal, g.camera.z_axis, depth_m);
      const double noise_px =
          model.detection.At(depth_m, std::acos(std::clamp(normal.dot(to_camera), -1.0, 1.0)));
      const double variance = noise_px * noise_px * by_image.squaredNorm();
      // A viewing direction within the sheet does not determine the height of a surface.
      if (normal.dot(to_camera) < 0.1 || !(variance > 1e-6 * noise_px * noise_px * scale * scale)) {
        continue;
      }
      best = std::max(best, columns_per_length / advance / variance);
    }
  }
  return best;
}

absl::Status CheckReach(const Inspection& inspection, const Requirements& requirements) {
  constexpr double kMargin = 4;
  const UncertaintyModel& model = *inspection.uncertainty;
  const double best = BestInformationDensity(inspection.rig, model, inspection.domain);
  const SurfacePrior prior{model.prior_standard_deviation_m,
                           CovarianceLengthScale(model.resolution_m)};
  const auto check = [&](const std::string& name, double zone_width_m) -> absl::Status {
    const double admissible_m = AdmissibleUncertainty(zone_width_m, requirements.rule);
    if (admissible_m >= prior.standard_deviation_m) return absl::OkStatus();
    const double scans = DensityForUncertainty(prior, admissible_m) / std::max(best, 1e-300);
    if (scans <= kMargin * inspection.goal.max_scans) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: a zone of %.4g mm is out of reach of this rig: it needs an uncertainty of %.3g um, "
        "which the best scan reaches after %.3g repetitions (a single scan gives %.3g um); "
        "goal.max_scans is %d",
        name, 1e3 * zone_width_m, 1e6 * admissible_m, scans,
        1e6 * UncertaintyAtDensity(prior, std::max(best, 1e-300)), inspection.goal.max_scans));
  };
  if (requirements.default_zone_width_m) {
    SIGHTLINE_RETURN_IF_ERROR(check("tolerances.zone_width_m", *requirements.default_zone_width_m));
  }
  for (const TolerancedFeature& feature : requirements.features) {
    if (!(feature.zone_width_m > 0)) continue;
    SIGHTLINE_RETURN_IF_ERROR(check(feature.name, feature.zone_width_m));
  }
  return absl::OkStatus();
}

}  // namespace sightline
