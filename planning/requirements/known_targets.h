// SPDX-License-Identifier: Apache-2.0
// The targets of a characteristic with the information of a plan or of a measurement.
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

// Knowledge that the scans of a plan, simulated or measured, give of the targets of one sampling.
struct PlanKnowledge {
  const TargetSet* targets;
  const TargetBits* measurable;
  std::vector<SurfaceUncertainty> uncertainty;  // exact, of every target after all scans
  std::vector<int32_t> points;                  // that inform about every target
  // For every scan, the equivalent information density of every target, or else its weight in the
  // estimate there: only the proportions of the scans count. Needed where errors are shared.
  std::vector<std::vector<float>> density;
  // Errors common to targets (SharedErrorsOf); without them all are independent.
  SharedErrors shared;
};

// `targets` are those of a BoundCharacteristic. Targets less certain than `known_m` [m] are not
// known.
Feature MakeFeature(const Inspection& inspection, const PlanKnowledge& knowledge,
                    const std::vector<uint32_t>& targets, double known_m);

// Most targets of a feature that are evaluated. Errors of profiles without datums need not be known
// jointly, since nothing is fitted: all targets count, and no defect falls between them.
size_t MostEvaluatedTargets(const Inspection& inspection, const TolerancedFeature& feature,
                            size_t scan_count);

// Takes the correlation of neighbours from a feature with more targets than may have one.
void LeaveOutCorrelation(const BoundCharacteristic& bound, Feature& feature);

// Largest uncertainty [m] of a target that is evaluated. Targets with only a few points at the
// border of the measured surface are hardly known, and would be left out of an evaluation: for form
// each has to be known admissibly, fitted parameters average over many, and deviations are judged
// one by one.
double KnownUncertainty(const Inspection& inspection, const Requirements& requirements,
                        const TolerancedFeature& feature);

// "; association: minimum zone (CHEBYSHEV)" or that of least squares, for the end of a reason;
// empty where the inspection states the default association.
std::string AssociationText(const Requirements& requirements, const TolerancedFeature& feature);

// The tolerance of the file that a feature stands for; null: it is a region of the inspection.
const Tolerance* ToleranceOf(const Requirements& requirements, const TolerancedFeature& feature);

// FAILED_PRECONDITION: the model has another size than the drawing means: its sizes or distances
// lie outside the limits by more than the zone's width. Tolerances without limits have no such
// size.
absl::Status CheckModelSizes(const Tolerance* tolerance, const CharacteristicFit& fit,
                             double zone_width_m);

// "; a good part is taken in the middle of its limits, 25 um from the modelled size", for the end
// of a reason. Empty: the model lies there within a twentieth of the zone, or there are no limits.
std::string MiddleOfLimitsText(const Tolerance* tolerance, const CharacteristicFit& fit);

// Gain [m] of the zone at the nominal size: its distance from the limit of maximum or least
// material, between 0 and the whole tolerance of the size. 0 without a material requirement.
double MaterialBonus(const TolerancedFeature& feature, const BoundCharacteristic& bound,
                     const Feature& targets);

}  // namespace sightline
