// SPDX-License-Identifier: Apache-2.0
// Bodies that a STEP file gives as triangles (AP242, ISO 10303-42 tessellated_item), which
// OpenCASCADE before 7.8 does not read: TESSELLATED_SOLID and TESSELLATED_SHELL of
// TRIANGULATED_FACEs, and TRIANGULATED_SURFACE_SETs, plain and COMPLEX (strips and fans). Vertices
// are shared as their COORDINATES_LIST shares them.
#pragma once

#include <string>
#include <vector>

#include "tools/step_import/shape_mesh.h"
#include "tools/step_import/tolerances/part21.h"

namespace sightline {

struct TessellatedBodies {
  std::vector<ShapeMesh> bodies;      // positions in millimetres
  std::vector<std::string> left_out;  // names of those of a product that has exact geometry, too
  std::vector<std::string> of_no_product;  // names of those that only shape aspects refer to
};

// The tessellated bodies of the products' shapes. `unit` as of SettleLengthUnit. Throws
// StepInputError if one is damaged or of a kind that is not read, if the file places tessellated
// bodies in an assembly, if some products are exact and others are tessellated only, and as
// SettleLengthUnit does.
TessellatedBodies ReadTessellation(const Part21File& file, const std::string& unit);

// Why a file without solids and surfaces has none: the types of what its shape representations
// hold.
std::string ItemTypesText(const Part21File& file);

}  // namespace sightline
