// SPDX-License-Identifier: Apache-2.0
// A plan and the tolerances it is for as a QIF 3.0 document (ANSI/DMSC QIF 3.0, ISO 23952:2020),
// for programs of quality management and coordinate metrology.
//
// Parts of the schema that are written, in its order of elements:
//   QIFDocument     QPId, Attributes (the plan's own numbers), Header, StandardsDefinitions (ISO
//                   14253-1, by which the verdicts decide), FileUnits (mm, degree)
//   Features        one OtherSurfaceFeature per tolerance: definition, nominal, item with name. A
//                   plan knows no geometry of features, so that nominals have none.
//   Characteristics one definition, nominal and item per tolerance, of the type of its kind; the
//                   prediction and the verdict are Attributes of the item. QIF has no place for
//                   the uncertainty of a measurement that has not been made.
//   Plan            WorkInstructions (one text per scan, with its parameters as Attributes),
//                   ActionMethods (OtherMeasureFeatureMethod per scan: QIF names no laser line
//                   triangulation), OrderedPlanRoot: a step MeasureSpecifiedFeatures per scan, then
//                   EvaluateSpecifiedCharacteristics
//   Results         with measured values: one measurement per characteristic, with its value,
//                   combined uncertainty (U over its coverage factor) and status; PASS, FAIL,
//                   INDETERMINATE or NOT_ANALYZED. Profiles have their worst deviations too.
// Persistent ids, UUIDs that stay the same from document to document: of a characteristic the UUID
// of its designator (the drawing's own if it has one), of a feature its UUID, of the plan
// Version/ThisInstanceQPId, of results ThisResultsInstanceQPId. Results name the plan by
// ReferencedQIFPlanInstance. Sightline writes no QIF rules. core/tolerance/qif/qif_results.h reads
// results of others back.
// Not written: datums and datum reference frames (their letters are an Attribute), Product,
// MeasurementResources. Where the schema demands what a plan does not know (the material
// condition and the zone's shape of position, orientation, straightness), the tolerance says it;
// without one, REGARDLESS and a zone that is no cylinder stand there, and an Attribute says that
// they are assumed. Attributes have names that end in their unit. Line profiles are user-defined
// characteristics: QIF demands the normal of the profile's plane, which no plan holds.
//
// Every document is valid by the schema of QIF 3.0; tests/written_formats validates documents of
// all kinds, numbers and texts with xmllint.
#pragma once

#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "core/tolerance/tolerance.h"
#include "sightline/v1/measured_result.pb.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// `tolerances`: those of the drawing. One with the id of a feature of plan.uncertainty
// supplies the limits, zone shape, datums and modifiers that a plan does not contain. The
// same input gives the same bytes. A plan for coverage has the whole surface as its one
// feature, and no characteristics. Numbers that are not finite, and texts that XML cannot
// contain, are left out or replaced. INVALID_ARGUMENT for a plan without scans and features.
// `measured`: values of the features of plan.uncertainty, in the same number and order; may
// be null.
absl::StatusOr<std::string> QifDocument(const v1::Plan& plan, const std::string& part_name,
                                        std::span<const Tolerance> tolerances = {},
                                        const v1::InspectionResult* measured = nullptr);

}  // namespace sightline
