// SPDX-License-Identifier: Apache-2.0
#include "planning/requirements/known_targets.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "core/surface_inference/surface_inference.h"

namespace sightline {
namespace {

Eigen::Vector3d CentreOf(const FeatureElement& element, const Feature& feature) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int t : element.targets) sum += feature.targets[static_cast<size_t>(t)].position_m;
  return sum / static_cast<double>(element.targets.size());
}

}  // namespace

Feature MakeFeature(const Inspection& inspection, const PlanKnowledge& knowledge,
                    const std::vector<uint32_t>& targets, double known_m) {
  Feature feature;
  for (const uint32_t t : targets) {
    FeatureTarget target;
    target.position_m = knowledge.targets->positions_m[t].cast<double>();
    target.normal = knowledge.targets->normals[t].cast<double>().normalized();
    target.uncertainty = knowledge.uncertainty[t];
    target.measured = knowledge.points[t] > 0;
    target.known = knowledge.uncertainty[t].total_m <= known_m;
    feature.targets.push_back(target);
  }
  feature.common_deviations_m = knowledge.shared.CalibrationDeviations(targets);
  feature.registration_deviations_m = knowledge.shared.RegistrationDeviations(targets);
  if (inspection.uncertainty->HasCalibrationErrors()) {
    // See Feature::correlation_length_m.
    feature.correlation_length_m = 2 * CovarianceLengthScale(inspection.uncertainty->resolution_m);
  }
  return feature;
}

size_t MostEvaluatedTargets(const Inspection& inspection, const TolerancedFeature& feature,
                            size_t scan_count) {
  const bool profile =
      feature.kind == ToleranceKind::kSurfaceProfile || feature.kind == ToleranceKind::kLineProfile;
  if (!profile || feature.association == Association::kChebyshev ||
      (!feature.id.empty() && inspection.uncertainty->HasCalibrationErrors())) {
    return kMostDenseTargets;
  }
  return std::min(kMostFeatureTargets, kMostFeatureSensitivities / std::max<size_t>(1, scan_count));
}

void LeaveOutCorrelation(const BoundCharacteristic& bound, Feature& feature) {
  if (bound.characteristic.exact_datum && feature.targets.size() > kMostDenseTargets) {
    feature.correlation_length_m = 0;
  }
}

double KnownUncertainty(const Inspection& inspection, const Requirements& requirements,
                        const TolerancedFeature& feature) {
  const double single_m = AdmissibleUncertainty(feature.zone_width_m, requirements.rule);
  // A minimum zone depends on every single target.
  if (feature.association == Association::kChebyshev) return single_m;
  switch (feature.kind) {
    case ToleranceKind::kSurfaceProfile:
    case ToleranceKind::kLineProfile:
      return inspection.uncertainty->prior_standard_deviation_m;
    case ToleranceKind::kFlatness:
    case ToleranceKind::kStraightness:
    case ToleranceKind::kRoundness:
    case ToleranceKind::kCylindricity:
    case ToleranceKind::kCircularRunout:
    case ToleranceKind::kTotalRunout:
      return single_m;
    default:
      return std::max(single_m, requirements.relaxed_uncertainty_m);
  }
}

std::string AssociationText(const Requirements& requirements, const TolerancedFeature& feature) {
  if (requirements.association == Association::kGauss) return "";
  return feature.association == Association::kChebyshev
             ? "; association: minimum zone (CHEBYSHEV)"
             : "; association: least squares (GAUSS), since it has no minimum zone";
}

const Tolerance* ToleranceOf(const Requirements& requirements, const TolerancedFeature& feature) {
  if (feature.id.empty()) return nullptr;
  for (const Tolerance& tolerance : requirements.tolerances) {
    if (tolerance.id == feature.id && tolerance.name == feature.name) return &tolerance;
  }
  return nullptr;
}

absl::Status CheckModelSizes(const Tolerance* tolerance, const CharacteristicFit& fit,
                             double zone_width_m) {
  if (tolerance == nullptr || !tolerance->lower_m || !tolerance->upper_m) return absl::OkStatus();
  for (const double size_m : fit.model_sizes_m) {
    if (size_m >= *tolerance->lower_m - zone_width_m &&
        size_m <= *tolerance->upper_m + zone_width_m) {
      continue;
    }
    return absl::FailedPreconditionError(
        absl::StrFormat("the model has %.4g mm, but the drawing allows %.4g to %.4g mm",
                        1e3 * size_m, 1e3 * *tolerance->lower_m, 1e3 * *tolerance->upper_m));
  }
  return absl::OkStatus();
}

std::string MiddleOfLimitsText(const Tolerance* tolerance, const CharacteristicFit& fit) {
  if (tolerance == nullptr || !tolerance->lower_m || !tolerance->upper_m) return "";
  const double middle_m = 0.5 * (*tolerance->lower_m + *tolerance->upper_m);
  double farthest_m = 0;
  for (const double size_m : fit.model_sizes_m) {
    if (std::abs(middle_m - size_m) > std::abs(farthest_m)) farthest_m = middle_m - size_m;
  }
  if (std::abs(farthest_m) <= 0.05 * (*tolerance->upper_m - *tolerance->lower_m)) return "";
  return absl::StrFormat(
      "; a good part is taken in the middle of its limits, %.3g um from the modelled size",
      1e6 * std::abs(farthest_m));
}

double MaterialBonus(const TolerancedFeature& feature, const BoundCharacteristic& bound,
                     const Feature& targets) {
  const Characteristic& c = bound.characteristic;
  if (c.material == MaterialRequirement::kNone) return 0;
  const FeatureElement& element = c.elements.front();
  const FeatureTarget& target = targets.targets[static_cast<size_t>(element.targets.front())];
  const Eigen::Vector3d outward =
      element.width ? Eigen::Vector3d(target.position_m - CentreOf(element, targets))
                    : DistanceGradient(element.surface, target.position_m, target.normal);
  const bool hole = outward.dot(target.normal) < 0;
  const bool from_smallest = hole == (c.material == MaterialRequirement::kMaximum);
  const double gain_m = from_smallest ? *feature.nominal_size_m - *feature.smallest_size_m
                                      : *feature.largest_size_m - *feature.nominal_size_m;
  return std::clamp(gain_m, 0.0, *feature.largest_size_m - *feature.smallest_size_m);
}

}  // namespace sightline
