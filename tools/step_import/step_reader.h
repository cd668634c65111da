// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <TopoDS_Shape.hxx>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/tolerance/tolerance.h"
#include "tools/step_import/step_input_error.h"

namespace sightline {

struct StepBody {
  std::string name;    // of the STEP product; "body" if it has none
  TopoDS_Shape shape;  // placed in the assembly, coordinates in millimetres
};

struct StepModel {
  std::vector<StepBody> bodies;  // never empty, each with at least one face
  std::string length_unit;       // as the file names it, e.g. "millimetre" or "INCH"
  // If asked for. Faces are counted from 1 through the bodies, in TopExp_Explorer's order in each.
  std::optional<ToleranceReport> tolerances;
};

// Reads a STEP file (ISO 10303-21: AP203, AP214, AP242). One body per solid; faces outside any
// solid are gathered into one body per product. Whatever unit the file uses, shapes come back in
// millimetres.
// Throws StepInputError if the file is missing, is not STEP, is cut off, cannot be parsed, has
// damaged geometry or holds no faces. OpenCASCADE's own Standard_Failure may escape when it fails
// inside.
StepModel ReadStep(const std::filesystem::path& file, bool with_tolerances = false);

}  // namespace sightline
