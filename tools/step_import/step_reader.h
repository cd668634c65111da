// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <TopoDS_Shape.hxx>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/tolerance/tolerance.h"
#include "tools/step_import/model/exchange_structure.h"
#include "tools/step_import/shape_mesh.h"
#include "tools/step_import/step_input_error.h"

namespace sightline {

struct StepBody {
  std::string name;    // of the STEP product; "body" if it has none
  TopoDS_Shape shape;  // placed in the assembly, coordinates in millimetres; null: `tessellation`
  ShapeMesh tessellation;  // of a body that the file gives as triangles; else empty
};

struct StepReadOptions {
  bool with_tolerances = false;
  // Take construction geometry (model/part_items.h) for the part.
  bool construction_geometry = false;
  // Length unit of a file that states none: "m", "cm", "mm", "um" or "inch".
  std::string unit;
};

struct StepModel {
  std::vector<StepBody> bodies;  // never empty, each with at least one face or triangle
  std::string length_unit;       // as the file names it, e.g. "millimetre", or `unit` as given
  // Names the items of the file that are not in `bodies`, in sentences for people.
  std::vector<std::string> remarks;
  // If asked for. Faces are counted from 1 through the bodies, in TopExp_Explorer's order in each.
  std::optional<ToleranceReport> tolerances;
};

// Reads a STEP file (ISO 10303-21: AP203, AP214, AP242). One body per solid; faces outside any
// solid are gathered into one body per product. Whatever unit the file uses, shapes come back in
// millimetres.
// Throws StepInputError if the file is damaged, holds no faces, refers to other files for its
// geometry, or if a body of the part cannot be translated; and as SettleLengthUnit and
// ReadTessellation do. OpenCASCADE's own Standard_Failure may escape when it fails inside.
StepModel ReadStep(const StepText& file, const StepReadOptions& options);
// The same of a file on disk. Throws also as ReadStepText.
StepModel ReadStep(const std::filesystem::path& file, bool with_tolerances = false);

}  // namespace sightline
