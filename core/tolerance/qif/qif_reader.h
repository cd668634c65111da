// SPDX-License-Identifier: Apache-2.0
// Tolerances of a QIF 3.0 file (ANSI/DMSC QIF 3.0, ISO 23952:2020).
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/tolerance/tolerance.h"

namespace sightline {

// Reads characteristics with their definitions, datums and features. One tolerance per
// characteristic nominal; those of a kind or form that cannot be read, definitions that nothing
// uses, and datum targets are listed with the reason. `features` names the features bound and the
// ids of their faces in the QIF file ("cylinder Hole 3 (feature 17, entities 561, 566)"); `faces`
// are numbers of `nominal_faces`, by which a mesh of the part is bound (FacesOnMesh).
//
// `schema_folder`: the QIF 3.0 schema to validate against, which the DMSC gives out; empty: only
// what is read is checked, and a note says so. `length_unit`: the unit of lengths for which the
// file states none ("mm", ...), see QifUnits. Errors as ReadQifXml and QifUnits, and
// INVALID_ARGUMENT with file, line and element for ids that are missing, doubled or lead nowhere,
// counts (attribute n) that are wrong, values that are no numbers.
absl::StatusOr<ToleranceReport> ReadQif(const std::string& file,
                                        const std::string& schema_folder = "",
                                        const std::string& length_unit = "");

}  // namespace sightline
