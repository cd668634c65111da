// SPDX-License-Identifier: Apache-2.0
// Targets of a characteristic with the information of a plan or of a measurement.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/conformance/feature.h"
#include "core/inspection/inspection.h"
#include "core/shared_errors/shared_errors.h"
#include "core/surface_inference/surface_inference.h"
#include "core/targets/target_set.h"
#include "planning/requirements/characteristic_of.h"
#include "planning/requirements/requirements.h"

namespace sightline {

// Information about the targets of one sampling by the scans of a plan, simulated or measured.
struct PlanKnowledge {
  const TargetSet* targets;
  const TargetBits* measurable;
  std::vector<SurfaceUncertainty> uncertainty;  // exact, of every target after all scans
  std::vector<int32_t> points;                  // that inform about every target
  // Per scan and target, the equivalent information density or the scan's weight in the estimate:
  // only the proportions of the scans count. Needed if scans share errors.
  std::vector<std::vector<float>> density;
  // Errors common to targets (SharedErrorsOf); if absent, all errors are independent.
  SharedErrors shared;
};

// `targets` are those of a BoundCharacteristic. Targets with an uncertainty above `known_m` [m]
// count as unknown.
Feature MakeFeature(const Inspection& inspection, const PlanKnowledge& knowledge,
                    const std::vector<uint32_t>& targets, double known_m);

// Largest number of targets that are evaluated. Profiles without datums fit nothing, so no joint
// covariance of their errors is needed: all targets count, and no defect falls between them.
size_t MostEvaluatedTargets(const Inspection& inspection, const TolerancedFeature& feature,
                            size_t scan_count);

// Removes the correlation of neighbours from a feature with too many targets for it.
void LeaveOutCorrelation(const BoundCharacteristic& bound, Feature& feature);

// Largest uncertainty [m] of an evaluated target. Targets with few points at the
// border of the measured surface are nearly as uncertain as before. Form needs the
// admissible uncertainty of each target; fitted parameters average over many and take
// the relaxed one; profile deviations are assessed one by one, up to the prior
// uncertainty.
double KnownUncertainty(const Inspection& inspection, const Requirements& requirements,
                        const TolerancedFeature& feature);

// "; association: minimum zone (CHEBYSHEV)" or that of least squares, for the end of a reason;
// empty where the inspection states the default association.
std::string AssociationText(const Requirements& requirements, const TolerancedFeature& feature);

// The tolerance in the file that a feature stands for; null for a region of the inspection.
const Tolerance* ToleranceOf(const Requirements& requirements, const TolerancedFeature& feature);

// FAILED_PRECONDITION if the sizes or distances of the model differ from those of the drawing:
// they lie outside the limits by more than the zone's width. Tolerances without limits always
// pass.
absl::Status CheckModelSizes(const Tolerance* tolerance, const CharacteristicFit& fit,
                             double zone_width_m);

// "; a good part is taken in the middle of its limits, 25 um from the modelled size", for the
// end of a reason. Empty without limits, or if the model is there within a twentieth of the
// zone.
std::string MiddleOfLimitsText(const Tolerance* tolerance, const CharacteristicFit& fit);

// Bonus of the zone [m] at nominal size: its distance from the maximum or least material limit,
// between 0 and the full size tolerance. 0 without a material requirement.
double MaterialBonus(const TolerancedFeature& feature, const BoundCharacteristic& bound,
                     const Feature& targets);

}  // namespace sightline
