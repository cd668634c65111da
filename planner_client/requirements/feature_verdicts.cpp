// SPDX-License-Identifier: Apache-2.0
#include "planner_client/requirements/feature_verdicts.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "absl/strings/str_cat.h"
#include "core/rig/scan_geometry.h"

namespace sightline {
namespace {

// Fits of three and more parameters need some targets to spare.
constexpr size_t kFewestTargets = 6;
// Joint covariances are dense (core/conformance): larger features are judged by every so many
// targets.
constexpr size_t kMostTargets = kMostDenseTargets;

struct Shape {
  FeatureGeometry geometry = FeatureGeometry::kFreeform;
  Eigen::Vector3d axis_point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
};

// Plane: normals agree. Cylinder: normals are perpendicular to one axis and positions are one
// radius from it, within what a mesh of flat facets leaves.
Shape ShapeOf(const std::vector<FeatureTarget>& targets) {
  constexpr double kFacet_rad = 10 * std::numbers::pi / 180;
  Shape shape;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const FeatureTarget& target : targets) {
    mean += target.normal;
    moments += target.normal * target.normal.transpose();
  }
  mean.normalize();
  const bool plane = std::all_of(targets.begin(), targets.end(), [&](const FeatureTarget& target) {
    return target.normal.dot(mean) > std::cos(0.5 * kFacet_rad);
  });
  if (plane) {
    shape.geometry = FeatureGeometry::kPlane;
    return shape;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(moments);
  const Eigen::Vector3d axis = axes.eigenvectors().col(0);  // of the smallest moment
  for (const FeatureTarget& target : targets) {
    if (std::abs(target.normal.dot(axis)) > std::sin(kFacet_rad)) return shape;
  }
  // p - r n lies on the axis: linear least squares for the axis's place across it, and r.
  const Eigen::Vector3d u = axes.eigenvectors().col(1), v = axes.eigenvectors().col(2);
  Eigen::MatrixXd a(2 * targets.size(), 3);
  Eigen::VectorXd b(2 * targets.size());
  for (size_t i = 0; i < targets.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(2 * i);
    a.row(row) << 1, 0, targets[i].normal.dot(u);
    a.row(row + 1) << 0, 1, targets[i].normal.dot(v);
    b(row) = targets[i].position_m.dot(u);
    b(row + 1) = targets[i].position_m.dot(v);
  }
  const Eigen::Vector3d fit = a.colPivHouseholderQr().solve(b);
  const double radius_m = std::abs(fit.z());
  if (!(radius_m > 0) || (a * fit - b).cwiseAbs().maxCoeff() > 0.2 * radius_m) return shape;
  shape.geometry = FeatureGeometry::kCylinder;
  shape.axis = axis;
  shape.axis_point_m = fit.x() * u + fit.y() * v;
  return shape;
}

// Errors of the lens are common to all scans, those of camera and laser each scan has its own.
void AddCalibration(const Inspection& inspection, std::span<const Measurement> scans,
                    const Eigen::Vector3d& part_centre_m, const PlanKnowledge& knowledge,
                    const std::vector<uint32_t>& chosen, Feature& feature) {
  constexpr int kOwn = kFocalLengthError - kCameraAlpha;  // variables of camera and laser
  const CalibrationCovariance covariance =
      inspection.uncertainty->calibration
          .bottomRightCorner<kCalibrationVariables, kCalibrationVariables>();
  CalibrationCovariance own = CalibrationCovariance::Zero();
  own.topLeftCorner<kOwn, kOwn>() = covariance.topLeftCorner<kOwn, kOwn>();
  constexpr int kLens = kCalibrationVariables - kOwn;
  feature.common_covariance.bottomRightCorner<kLens, kLens>() =
      covariance.bottomRightCorner<kLens, kLens>();
  for (size_t s = 0; s < scans.size(); ++s) {
    ScanSensitivity sensitivity;
    const auto count = static_cast<Eigen::Index>(chosen.size());
    sensitivity.derivatives.resize(count, kCalibrationVariables);
    sensitivity.weights = Eigen::VectorXd::Zero(count);
    sensitivity.covariance = own;
    const ScanGeometry geometry = MakeScanGeometry(inspection.rig, scans[s]);
    for (Eigen::Index i = 0; i < count; ++i) {
      const uint32_t t = chosen[static_cast<size_t>(i)];
      double sum = 0;
      for (const auto& scan : knowledge.density) sum += scan[t];
      const Eigen::Vector3d position = knowledge.targets->positions_m[t].cast<double>();
      const double stage_m =
          geometry.LitStagePosition(PartToWorld(geometry, part_centre_m, position, 0));
      const TriangulationSetup setup = MakeTriangulationSetup(
          inspection.rig.camera, WorldToPart(geometry, part_centre_m, geometry.camera, stage_m),
          WorldToPart(geometry, part_centre_m, geometry.laser, stage_m));
      const CalibrationRow row =
          CalibrationDerivatives(setup, position, knowledge.targets->normals[t].cast<double>());
      // Scans count by the information they bring.
      const bool usable = sum > 0 && row.allFinite();
      sensitivity.weights(i) = usable ? knowledge.density[s][t] / sum : 0;
      sensitivity.derivatives.row(i) = usable ? row : CalibrationRow::Zero().eval();
    }
    feature.scans.push_back(std::move(sensitivity));
  }
}

struct Chosen {
  std::vector<uint32_t> targets;
  Feature feature;
};

Chosen MakeFeature(const Inspection& inspection, std::span<const Measurement> scans,
                   const Eigen::Vector3d& part_centre_m, const PlanKnowledge& knowledge,
                   const std::vector<uint32_t>& all, double known_m) {
  Chosen chosen;
  const size_t stride = (all.size() + kMostTargets - 1) / kMostTargets;
  for (size_t i = 0; i < all.size(); i += stride) chosen.targets.push_back(all[i]);
  for (const uint32_t t : chosen.targets) {
    FeatureTarget target;
    target.position_m = knowledge.targets->positions_m[t].cast<double>();
    target.normal = knowledge.targets->normals[t].cast<double>().normalized();
    target.uncertainty = knowledge.uncertainty[t];
    target.measured = knowledge.points[t] > 0 && knowledge.uncertainty[t].total_m <= known_m;
    chosen.feature.targets.push_back(target);
  }
  const Shape shape = ShapeOf(chosen.feature.targets);
  chosen.feature.geometry = shape.geometry;
  chosen.feature.axis = shape.axis;
  chosen.feature.axis_point_m = shape.axis_point_m;
  if (inspection.uncertainty->HasCalibrationErrors()) {
    AddCalibration(inspection, scans, part_centre_m, knowledge, chosen.targets, chosen.feature);
    // See Feature::correlation_length_m.
    chosen.feature.correlation_length_m =
        2 * CovarianceLengthScale(inspection.uncertainty->resolution_m);
  }
  return chosen;
}

}  // namespace

absl::StatusOr<std::vector<v1::FeatureVerdict>> JudgeFeatures(const Inspection& inspection,
                                                              const Requirements& requirements,
                                                              std::span<const Measurement> scans,
                                                              const Eigen::Vector3d& part_centre_m,
                                                              const PlanKnowledge& knowledge) {
  std::vector<v1::FeatureVerdict> verdicts;
  for (const TolerancedFeature& toleranced : requirements.features) {
    v1::FeatureVerdict& verdict = verdicts.emplace_back();
    verdict.set_id(toleranced.id);
    verdict.set_name(toleranced.name);
    verdict.set_kind(ToleranceKindName(toleranced.kind));
    verdict.set_zone_width_m(toleranced.zone_width_m);
    const double admissible_m = AdmissibleUncertainty(toleranced.zone_width_m, requirements.rule);
    verdict.set_admissible_uncertainty_m(admissible_m);
    const std::vector<uint32_t> all = requirements.TargetsOf(toleranced, *knowledge.targets);
    verdict.set_targets(static_cast<int64_t>(all.size()));
    for (const uint32_t t : all) {
      verdict.set_measured_targets(verdict.measured_targets() + (knowledge.points[t] > 0));
      verdict.set_admissible_targets(verdict.admissible_targets() +
                                     (knowledge.uncertainty[t].total_m <= admissible_m));
    }
    const auto cannot = [&](const std::string& because) {
      verdict.set_can_be_proven(false);
      verdict.set_because(because);
    };
    if (all.size() < kFewestTargets) {
      cannot(absl::StrCat("only ", all.size(), " targets lie on it, at least ", kFewestTargets,
                          " are needed: sample it more densely (targets.spacing_m or a region)"));
      continue;
    }
    const std::optional<ToleranceMeasurand> measurand = MeasurandOf(toleranced.kind);
    if (!measurand) {
      cannot(absl::StrCat(verdict.kind(), " is not predicted"));
      continue;
    }
    // Targets that a few points at the border of the measured surface tell of are hardly known, and
    // would be left out of an evaluation: for form each has to be known admissibly, fitted
    // parameters average over many, and deviations are judged one by one.
    const double known_m = measurand->measurand == Measurand::kDeviation
                               ? inspection.uncertainty->prior_standard_deviation_m
                           : measurand->measurand == Measurand::kForm
                               ? admissible_m
                               : std::max(admissible_m, requirements.relaxed_uncertainty_m);
    const Chosen chosen = MakeFeature(inspection, scans, part_centre_m, knowledge, all, known_m);
    if (chosen.feature.geometry == FeatureGeometry::kFreeform &&
        measurand->measurand != Measurand::kDeviation) {
      cannot("its targets lie neither on a plane nor on a cylinder, so nothing is fitted");
      continue;
    }
    ConformanceOptions options;
    options.rule = requirements.rule;
    auto judged = JudgeFeature(chosen.feature, measurand->measurand,
                               {measurand->zone, toleranced.zone_width_m}, options);
    if (!judged.ok()) {
      cannot(std::string(judged.status().message()));
      continue;
    }
    verdict.set_uncertainty_m(judged->u.total_m);
    verdict.set_noise_m(judged->u.noise_m);
    verdict.set_sampling_m(judged->u.sampling_m);
    verdict.set_calibration_m(judged->u.calibration_m);
    verdict.set_acceptance_zone_m(std::max(0.0, judged->acceptance_zone_m));
    verdict.set_probability_wrong_acceptance(judged->probability_wrong_acceptance);
    verdict.set_probability_wrong_rejection(judged->probability_wrong_rejection);
    verdict.set_can_be_proven(judged->can_be_proven);
    verdict.set_because(judged->because);
  }
  return verdicts;
}

}  // namespace sightline
