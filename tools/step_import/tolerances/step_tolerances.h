// SPDX-License-Identifier: Apache-2.0
// The tolerances of a STEP file bound to the faces of its imported shapes.
#pragma once

#include <Standard_Handle.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shape.hxx>
#include <filesystem>
#include <vector>

#include "core/tolerance/tolerance.h"

class STEPCAFControl_Reader;
class TDocStd_Document;

namespace sightline {

// Faces of all bodies in the order of the import, in which they are counted from 1.
std::vector<TopoDS_Face> FacesInOrder(const std::vector<TopoDS_Shape>& bodies);

// Tolerances of `file`, which `reader` has read with its GD&T mode on and translated into
// `document` and `bodies`. Values come from the file's entities (step_pmi.h); OpenCASCADE's own
// reading of them (XCAF) is compared with it, since it loses values and mixes units, and what
// differs is in the notes. A face that stands in an assembly several times is bound at each place.
// Throws StepInputError if the file cannot be read.
ToleranceReport ReadStepTolerances(const std::filesystem::path& file, STEPCAFControl_Reader& reader,
                                   const Handle(TDocStd_Document) & document,
                                   const std::vector<TopoDS_Shape>& bodies);

}  // namespace sightline
