// SPDX-License-Identifier: Apache-2.0
#include "planner_client/inspect/judge_measured.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/association/minimum_zone.h"
#include "core/conformance/acceptance.h"
#include "core/conformance/measured_value.h"
#include "core/inspection/vector_proto.h"
#include "core/statistics/order_statistics.h"
#include "planning/requirements/characteristic_of.h"
#include "planning/requirements/joined_scans.h"
#include "planning/requirements/known_targets.h"

namespace sightline {
namespace {

using Decision = v1::InspectedFeature::Decision;

// Inputs that all features are judged by.
struct MeasuredState {
  const Inspection& inspection;  // with the placement of the part
  const Requirements& requirements;
  const MeasuredSurface& surface;
  PlanKnowledge knowledge;
};

Decision DecisionOf(Conformity conformity) {
  switch (conformity) {
    case Conformity::kConforms:
      return v1::InspectedFeature::CONFORMS;
    case Conformity::kDoesNotConform:
      return v1::InspectedFeature::DOES_NOT_CONFORM;
    case Conformity::kUndecided:
      break;
  }
  return v1::InspectedFeature::UNDECIDED;
}

// Deviations of the targets from the nominal surfaces. Measured ones are from the facets of the
// mesh, whose places lie up to the chord tolerance off them.
Eigen::VectorXd DeviationsOf(const MeasuredState& state, const BoundCharacteristic& bound,
                             const Feature& feature) {
  Eigen::VectorXd deviations_m(static_cast<Eigen::Index>(bound.targets.size()));
  for (size_t i = 0; i < bound.targets.size(); ++i) {
    deviations_m[static_cast<Eigen::Index>(i)] = state.surface.estimates[bound.targets[i]].mean_m;
  }
  const Characteristic& c = bound.characteristic;
  if (c.exact_datum) return deviations_m;
  std::vector<bool> done(bound.targets.size(), false);
  const auto correct = [&](const FeatureElement& element) {
    if (element.width || element.surface.kind == SurfaceKind::kFreeform) return;
    for (const int t : element.targets) {
      const auto i = static_cast<size_t>(t);
      if (done[i]) continue;
      done[i] = true;
      const FeatureTarget& target = feature.targets[i];
      const Eigen::Vector3d gradient =
          DistanceGradient(element.surface, target.position_m, target.normal);
      const double side = gradient.dot(target.normal) < 0 ? -1 : 1;
      deviations_m[t] += side * SignedDistance(element.surface, target.position_m);
    }
  };
  for (const FeatureElement& element : c.elements) correct(element);
  for (const auto& datum : c.datums) {
    for (const FeatureElement& element : datum) correct(element);
  }
  return deviations_m;
}

// Surfaces of form whose association is the minimum zone, put where the measured points have it:
// what a fit leaves is of second order in the displacement of a curved surface. Targets get their
// distances from there. Surfaces without a fit keep their nominal place.
void PlaceMinimumZones(const MeasuredState& state, const std::vector<uint32_t>& targets,
                       const Feature& feature, Characteristic& c, Eigen::VectorXd& deviations_m) {
  const bool profile =
      c.kind == ToleranceKind::kSurfaceProfile || c.kind == ToleranceKind::kLineProfile;
  if (c.association != Association::kChebyshev || profile) return;
  for (FeatureElement& element : c.elements) {
    std::vector<Eigen::Vector3d> points, normals;
    std::vector<int> used;
    for (const int t : element.targets) {
      const FeatureTarget& target = feature.targets[static_cast<size_t>(t)];
      if (!target.used()) continue;
      const double mean_m = state.surface.estimates[targets[static_cast<size_t>(t)]].mean_m;
      points.push_back(target.position_m + mean_m * target.normal);
      normals.push_back(target.normal);
      used.push_back(t);
    }
    const auto zone = FitMinimumZone(element.surface.kind, points, normals);
    if (!zone) continue;
    element.surface = zone->surface;
    for (size_t i = 0; i < used.size(); ++i) {
      const Eigen::Vector3d gradient = DistanceGradient(element.surface, points[i], normals[i]);
      const double side = gradient.dot(normals[i]) < 0 ? -1 : 1;
      deviations_m[used[i]] = side * SignedDistance(element.surface, points[i]);
    }
  }
}

// Limits of a size. Errors of CheckModelSizes.
absl::Status SetLimits(const Tolerance* tolerance, const CharacteristicFit& fit,
                       MeasuredZone& zone) {
  if (fit.model_sizes_m.empty() || tolerance == nullptr || !tolerance->lower_m ||
      !tolerance->upper_m || !(*tolerance->lower_m < *tolerance->upper_m)) {
    return absl::OkStatus();
  }
  zone.lower_m = tolerance->lower_m;
  zone.upper_m = tolerance->upper_m;
  return CheckModelSizes(tolerance, fit, zone.width_m);
}

void SetValue(const MeasuredValue& value, const MeasuredZone& zone, const Feature& feature,
              v1::InspectedFeature& message) {
  message.set_decision(DecisionOf(value.decision));
  message.set_because(value.because);
  message.set_value_m(value.value_m);
  message.set_expanded_uncertainty_m(kExpansion * value.uncertainty_m);
  message.set_interval_lower_m(value.interval.lower_m);
  message.set_interval_upper_m(value.interval.upper_m);
  if (zone.lower_m) message.set_lower_limit_m(*zone.lower_m);
  if (zone.upper_m) message.set_upper_limit_m(*zone.upper_m);
  if (value.bias_m > 0) message.set_bias_m(value.bias_m);
  if (!value.deviations) return;
  message.set_smallest_deviation_m(value.deviations->lower_m);
  message.set_largest_deviation_m(value.deviations->upper_m);
  if (value.worst_target < 0) return;
  *message.mutable_worst_place_m() =
      VectorToProto(feature.targets[static_cast<size_t>(value.worst_target)].position_m);
}

void SetUndecided(absl::string_view reason, v1::InspectedFeature& message) {
  message.set_decision(v1::InspectedFeature::UNDECIDED);
  message.set_because(absl::StrCat("undecided: ", reason));
}

void SetNoEvaluation(absl::string_view reason, v1::InspectedFeature& message) {
  message.set_decision(v1::InspectedFeature::NOT_EVALUATED);
  message.set_because(absl::StrCat("not evaluated: ", reason));
}

// Values and decision of a feature whose surfaces are known.
void JudgeBoundFeature(const MeasuredState& state, const TolerancedFeature& toleranced,
                       const BoundCharacteristic& bound, ConformanceOptions options,
                       v1::InspectedFeature& message) {
  Feature feature =
      MakeFeature(state.inspection, state.knowledge, bound.targets, *options.known_uncertainty_m);
  LeaveOutCorrelation(bound, feature);
  // The pose of the joined scans counts beside the errors of joining them.
  Eigen::MatrixXd& registration_m = feature.registration_deviations_m;
  const Eigen::MatrixXd& of_pose_m = state.surface.pose_deviations_m;
  registration_m.conservativeResize(Eigen::NoChange, registration_m.cols() + of_pose_m.cols());
  for (size_t i = 0; i < bound.targets.size(); ++i) {
    registration_m.row(static_cast<Eigen::Index>(i)).tail(of_pose_m.cols()) =
        of_pose_m.row(bound.targets[i]);
  }
  Characteristic characteristic = bound.characteristic;
  Eigen::VectorXd deviations_m = DeviationsOf(state, bound, feature);
  PlaceMinimumZones(state, bound.targets, feature, characteristic, deviations_m);
  const auto fit = FitCharacteristic(feature, characteristic);
  if (absl::IsFailedPrecondition(fit.status()))
    return SetUndecided(fit.status().message(), message);
  if (!fit.ok()) return SetNoEvaluation(fit.status().message(), message);
  MeasuredZone zone;
  zone.width_m = toleranced.zone_width_m;
  if (toleranced.zone_width_rad > 0) {
    zone.width_m = toleranced.zone_width_rad * fit->reference_length_m;
    message.set_reference_length_m(fit->reference_length_m);
  }
  message.set_zone_width_m(zone.width_m);
  const Tolerance* tolerance = ToleranceOf(state.requirements, toleranced);
  if (absl::Status s = SetLimits(tolerance, *fit, zone); !s.ok()) {
    return SetNoEvaluation(s.message(), message);
  }
  const double bonus_m = MaterialBonus(toleranced, bound, feature);
  if (bonus_m > 0) message.set_material_bonus_m(bonus_m);
  zone.width_m += bonus_m;
  const auto value = EvaluateMeasured(feature, *fit, deviations_m, zone, options);
  if (absl::IsFailedPrecondition(value.status())) {
    return SetUndecided(value.status().message(), message);
  }
  if (!value.ok()) return SetNoEvaluation(value.status().message(), message);
  SetValue(*value, zone, feature, message);
  message.mutable_because()->append(AssociationText(state.requirements, toleranced));
}

// Uncertainties with which an undecided feature may be decided (JudgedInspection::needed).
std::vector<NeededUncertainty> NeededUncertainties(const MeasuredState& state,
                                                   const TolerancedFeature& feature,
                                                   const std::vector<uint32_t>& targets) {
  const DecisionRule& rule = state.requirements.rule;
  const bool profile =
      feature.kind == ToleranceKind::kSurfaceProfile || feature.kind == ToleranceKind::kLineProfile;
  const int64_t largest_of = profile ? std::max<int64_t>(1, std::ssize(targets)) : 1;
  const bool has_zone = feature.zone_width_m > 0;
  const auto provable_m =
      static_cast<float>(has_zone ? ProvableUncertainty(feature.zone_width_m, rule, largest_of)
                                  : state.requirements.relaxed_uncertainty_m);
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  Eigen::VectorXd target_u_m(std::ssize(targets));
  TargetCounts counts{.all = std::ssize(targets)};
  for (size_t i = 0; i < targets.size(); ++i) {
    const bool measured = state.knowledge.points[targets[i]] > 0;
    target_u_m[static_cast<Eigen::Index>(i)] =
        measured ? state.knowledge.uncertainty[targets[i]].total_m : kUnknown;
    counts.measured = counts.used += measured;
  }
  double bound_m = kUnknown;
  if (has_zone) {
    bound_m = profile ? KnownBound(target_u_m, feature.zone_width_m, rule, counts,
                                   ConformanceOptions{}.required_share)
                      : AdmissibleUncertainty(feature.zone_width_m, rule);
  }
  std::vector<NeededUncertainty> needed;
  std::vector<size_t> known;  // indices into `needed`
  std::vector<double> uncertainties_m;
  for (size_t i = 0; i < targets.size(); ++i) {
    needed.push_back({state.surface.targets.positions_m[targets[i]], provable_m});
    const double u_m = target_u_m[static_cast<Eigen::Index>(i)];
    if (std::isinf(u_m) || u_m > bound_m) continue;
    known.push_back(i);
    uncertainties_m.push_back(u_m);
  }
  if (static_cast<double>(known.size()) <
      ConformanceOptions{}.required_share * static_cast<double>(targets.size())) {
    return needed;
  }
  bool held_back = false;
  for (size_t i = 0; i < known.size(); ++i) {
    NeededUncertainty& entry = needed[known[i]];
    entry.uncertainty_m = 0;
    if (!profile || !has_zone) continue;
    const double deviation_m = std::abs(state.surface.estimates[targets[known[i]]].mean_m);
    const double room_m = std::abs(0.5 * feature.zone_width_m - deviation_m);
    if (room_m >= rule.guard_factor * uncertainties_m[i]) continue;
    held_back = true;
    entry.uncertainty_m =
        static_cast<float>(std::max(room_m / rule.guard_factor, 0.5 * uncertainties_m[i]));
  }
  if (held_back || known.empty()) return needed;
  const float half_m = std::min(provable_m, static_cast<float>(0.5 * UpperMedian(uncertainties_m)));
  for (const size_t i : known) needed[i].uncertainty_m = half_m;
  return needed;
}

v1::InspectedFeature Describe(const std::string& id, const std::string& name, ToleranceKind kind,
                              const std::string& text, double zone_width_m) {
  v1::InspectedFeature message;
  message.set_id(id.empty() ? name : id);
  message.set_name(name);
  message.set_kind(ToleranceKindName(kind));
  message.set_text(text);
  if (zone_width_m > 0) message.set_zone_width_m(zone_width_m);
  return message;
}

v1::InspectedFeature JudgeToleranced(const MeasuredState& state,
                                     const TolerancedFeature& toleranced,
                                     std::vector<NeededUncertainty>* needed) {
  v1::InspectedFeature message = Describe(toleranced.id, toleranced.name, toleranced.kind,
                                          toleranced.text, toleranced.zone_width_m);
  const std::vector<uint32_t> all = state.requirements.TargetsOf(toleranced, state.surface.targets);
  ConformanceOptions options;
  options.rule = state.requirements.rule;
  const double known_m = KnownUncertainty(state.inspection, state.requirements, toleranced);
  options.known_uncertainty_m = known_m;
  TargetCounts& counts = options.counts.emplace();
  for (const uint32_t t : all) {
    const bool measured = state.knowledge.points[t] > 0;
    ++counts.all;
    counts.measured += measured;
    counts.used += measured && state.knowledge.uncertainty[t].total_m <= known_m;
  }
  message.set_targets(counts.all);
  message.set_measured_targets(counts.measured);
  const auto bound = BindCharacteristic(
      toleranced, state.requirements, state.surface.targets,
      MostEvaluatedTargets(state.inspection, toleranced, state.knowledge.density.size()));
  if (!bound.ok()) {
    SetNoEvaluation(bound.status().message(), message);
  } else {
    JudgeBoundFeature(state, toleranced, *bound, options, message);
  }
  if (message.decision() == v1::InspectedFeature::UNDECIDED) {
    *needed = NeededUncertainties(state, toleranced, all);
  }
  return message;
}

void DescribeScans(const MeasuredPart& part, v1::InspectionResult& result) {
  for (size_t f = 0; f < part.files.size(); ++f) {
    const MeasuredPart::PointCounts& counts = part.counts[f];
    v1::InspectedScan& scan = *result.add_scans();
    scan.set_name(part.message.scans(static_cast<int>(f)).file());
    scan.set_scan(part.files[f].scan + 1);
    scan.set_points(counts.read);
    scan.set_outliers(counts.among_neighbours + counts.off_model);
    scan.set_outliers_among_neighbours(counts.among_neighbours);
    scan.set_outliers_off_the_model(counts.off_model);
    scan.set_duplicates(counts.duplicates);
    scan.set_without_value(counts.without_value);
    scan.set_registration_rms_m(counts.rms_m);
    if (100 * scan.outliers() > 5 * counts.read) {
      result.add_warnings(absl::StrFormat("%s: %d of %d points are outliers and are not used.",
                                          scan.name(), scan.outliers(), counts.read));
    }
  }
}

}  // namespace

JudgedInspection JudgeMeasured(const Inspection& inspection, const Requirements& requirements,
                               const MeasuredPart& part, std::span<const Measurement> scans,
                               const MeasuredSurface& surface) {
  Inspection placed = inspection;
  placed.rig.part_placement = part.placement;
  MeasuredState state{placed, requirements, surface, surface.Knowledge()};
  if (HasSharedErrors(placed)) {
    std::vector<Measurement> measured;
    for (const MeasuredFile& file : part.files) {
      measured.push_back(scans[static_cast<size_t>(file.scan)]);
    }
    state.knowledge.shared = SharedErrorsOf(placed, requirements, measured, part.placement.centre_m,
                                            state.knowledge, placed.uncertainty->registration);
  }
  JudgedInspection judged;
  v1::InspectionResult& result = judged.result;
  result.set_expansion_factor(kExpansion);
  result.set_guard_factor(requirements.rule.guard_factor);
  *result.mutable_as_measured() = part.message;
  DescribeScans(part, result);
  for (const TolerancedFeature& feature : requirements.features) {
    *result.add_features() = JudgeToleranced(state, feature, &judged.needed.emplace_back());
  }
  for (const UnboundTolerance& unbound : requirements.unbound) {
    const Tolerance& t = unbound.tolerance;
    v1::InspectedFeature& message = *result.add_features();
    message = Describe(t.id, t.name, t.kind, t.text, t.zone_width_m);
    SetNoEvaluation(unbound.reason, message);
  }
  result.mutable_surface()->set_targets(static_cast<int64_t>(surface.targets.size()));
  result.mutable_surface()->set_measured_targets(
      std::count_if(surface.estimates.begin(), surface.estimates.end(),
                    [](const DeviationEstimate& estimate) { return estimate.points > 0; }));
  if (part.message.not_fixed_size() > 0) {
    result.add_warnings(absl::StrFormat(
        "The points do not fix %d of the 6 degrees of freedom of the part. Features without datums "
        "are as uncertain as its place before the measurement.",
        part.message.not_fixed_size()));
  }
  return judged;
}

}  // namespace sightline
