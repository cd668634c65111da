// SPDX-License-Identifier: Apache-2.0
// The tolerances of a STEP file bound to the faces of its imported shapes.
#pragma once

#include <Standard_Handle.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shape.hxx>
#include <vector>

#include "core/tolerance/tolerance.h"
#include "tools/step_import/model/exchange_structure.h"
#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/step_pmi.h"

class STEPCAFControl_Reader;
class TDocStd_Document;

namespace sightline {

// Faces of all bodies in the order of the import, in which they are counted from 1.
std::vector<TopoDS_Face> FacesInOrder(const std::vector<TopoDS_Shape>& bodies);

// Values come from the file's entities (step_pmi.h); OpenCASCADE's own reading of them (XCAF) is
// compared with it, since it loses values and mixes units, and what differs is in the notes.
class StepTolerances {
 public:
  // Reads the entities of a file, before OpenCASCADE follows their references with more memory for
  // each. Throws StepInputError as Part21File and ReadStepPmi do.
  explicit StepTolerances(const StepText& file);

  // Whether OpenCASCADE is to read them too (its GD&T mode), which takes far longer: of files whose
  // tolerances and bound entities are not unusually many.
  bool compared() const { return pmi_.work <= kMostWork / 10; }

  // Binds them to the shapes that `reader`, with GD&T mode if compared(), has translated into
  // `document` and `bodies`. A face that stands in an assembly several times is bound at each
  // place. Once only. Throws StepInputError if they bind more than kMostBoundFaces.
  ToleranceReport Bind(STEPCAFControl_Reader& reader, const Handle(TDocStd_Document) & document,
                       const std::vector<TopoDS_Shape>& bodies);

 private:
  Part21File entities_;
  StepPmi pmi_;
};

}  // namespace sightline
