// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/document/uncertainty_outputs.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/file/atomic_write.h"
#include "core/rig/scan_geometry.h"
#include "core/status/status_macros.h"
#include "core/triangulation/triangulation.h"
#include "report/uncertainty/inadmissible.h"
#include "report/uncertainty/qif_export.h"
#include "report/uncertainty/uncertainty_ply.h"

namespace sightline {
namespace {

// The triangulation of one measured point, in part coordinates.
struct PointSetup {
  TriangulationSetup setup;
  Eigen::Vector2d image_px;
  Eigen::Vector3d position_m, normal;
};

PointSetup SetupOf(const PlanningSession& session, const ScanGeometry& geometry,
                   const ScanPoint& point) {
  const Rig& rig = session.inspection.rig;
  const Eigen::Vector3d centre = session.client->scene().part_centre_m;
  const double stage_m = point.frame * rig.scan_step_m;
  PointSetup result;
  result.setup =
      MakeTriangulationSetup(rig.camera, WorldToPart(geometry, centre, geometry.camera, stage_m),
                             WorldToPart(geometry, centre, geometry.laser, stage_m));
  result.position_m = point.position_m.cast<double>();
  result.normal = point.normal.cast<double>();
  result.image_px = ProjectPoint(result.setup, result.position_m);
  return result;
}

// Every so many of `count`, at most `most`.
size_t StrideFor(size_t count, size_t most) {
  return std::max<size_t>(1, (count + most - 1) / most);
}

}  // namespace

TargetUncertainties TargetUncertaintiesOf(const PlanningSession& session,
                                          const PlanDocument& document) {
  const auto doubles = [](const std::vector<float>& values) {
    return std::vector<double>(values.begin(), values.end());
  };
  const PosteriorUncertainties& u = document.uncertainties;
  TargetUncertainties result{doubles(u.total_m),
                             doubles(u.noise_m),
                             doubles(u.sampling_m),
                             doubles(u.calibration_m),
                             doubles(u.registration_m),
                             doubles(document.admissible_uncertainty_m),
                             session.requirements->relaxed_uncertainty_m,
                             {},
                             {},
                             {}};
  const TargetSet& targets = session.client->targets();
  TargetBits covered(targets.size());
  for (const ChosenScan& scan : document.scans) covered |= scan.exact.covered;
  result.limits =
      UncertaintyLimits(result, session.client->measurable(), covered, u.points, targets.regions);
  for (const TolerancedFeature& feature : session.requirements->features) {
    result.feature_targets.push_back(
        session.requirements->TargetsOf(feature, session.client->targets()));
  }
  // One for every verdict.
  result.feature_targets.resize(result.feature_targets.size() +
                                session.requirements->unbound.size());
  return result;
}

ScanSensitivityMap SensitivityOf(const PlanningSession& session, const Measurement& scan,
                                 const std::vector<ScanPoint>& points) {
  constexpr size_t kMostPoints = 50'000;
  const UncertaintyModel& model = *session.inspection.uncertainty;
  const ScanGeometry geometry = MakeScanGeometry(session.inspection.rig, scan);
  ScanSensitivityMap map;
  for (size_t i = 0; i < points.size(); i += StrideFor(points.size(), kMostPoints)) {
    const PointSetup point = SetupOf(session, geometry, points[i]);
    const auto derivatives = PointDerivatives(point.setup, point.image_px);
    const Eigen::RowVectorXd along = point.normal.transpose() * derivatives;
    if (!along.allFinite()) continue;
    const auto deviation = [&](const TriangulationCovariance& covariance) {
      return static_cast<float>(std::sqrt(std::max(0.0, (along * covariance).dot(along))));
    };
    map.positions_m.push_back(points[i].position_m);
    map.detection_m.push_back(
        deviation(DetectionCovariance(model, point.setup.camera, point.position_m, point.normal)));
    if (model.HasCalibrationErrors()) map.calibration_m.push_back(deviation(model.calibration));
  }
  return map;
}

absl::Status WriteUncertaintyFiles(const PlanningSession& session, const PlanDocument& document,
                                   const TargetUncertainties& uncertainties,
                                   const std::string& folder) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto ply, UncertaintyPly(session.client->targets(), uncertainties,
                                                      session.client->measurable()));
  absl::Status status = WriteFileAtomically(folder + "/uncertainty.ply", ply);
  if (!status.ok() || document.plan.uncertainty().features().empty()) return status;
  SIGHTLINE_ASSIGN_OR_RETURN(auto qif, QifDocument(document.plan, session.inspection.name,
                                                   session.requirements->tolerances));
  return WriteFileAtomically(folder + "/plan.qif", qif);
}

absl::Status WriteEllipsoids(const PlanningSession& session, const Measurement& scan,
                             const std::vector<ScanPoint>& points, const std::string& path) {
  constexpr size_t kShown = 2000;
  constexpr double kLargestAxis_m = 1e-3;
  const UncertaintyModel& model = *session.inspection.uncertainty;
  const ScanGeometry geometry = MakeScanGeometry(session.inspection.rig, scan);
  std::vector<CovarianceEllipsoid> ellipsoids;
  double largest_m = 0;
  for (size_t i = 0; i < points.size(); i += StrideFor(points.size(), kShown)) {
    const PointSetup point = SetupOf(session, geometry, points[i]);
    const Eigen::Matrix3d covariance = FirstOrderCovariance(
        point.setup, point.image_px,
        model.calibration +
            DetectionCovariance(model, point.setup.camera, point.position_m, point.normal));
    if (!covariance.allFinite()) continue;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance, Eigen::EigenvaluesOnly);
    largest_m = std::max(largest_m, std::sqrt(std::max(0.0, axes.eigenvalues().z())));
    ellipsoids.push_back({point.position_m, covariance});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto ply,
      CovarianceEllipsoidsPly(ellipsoids, largest_m > 0 ? kLargestAxis_m / largest_m : 1));
  return WriteFileAtomically(path, ply);
}

}  // namespace sightline
