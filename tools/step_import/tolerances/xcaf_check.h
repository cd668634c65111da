// SPDX-License-Identifier: Apache-2.0
// A second reading of a STEP file's tolerances, OpenCASCADE's own (XCAF), to compare with.
#pragma once

#include <Standard_Handle.hxx>
#include <TopoDS_Shape.hxx>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "core/tolerance/tolerance.h"

class TDocStd_Document;

namespace sightline {

// Faces that all tolerances and datums of a file bind together. Their numbers are values of the
// report's JSON, of which 2 000 000 are read.
inline constexpr size_t kMostBoundFaces = 1'500'000;

// Numbers of the faces that share one underlying shape: one per place in the assembly.
using FaceNumbers = std::map<const TopoDS_TShape*, std::vector<int>>;

// Numbers of all faces of `shape`, ascending, each once; empty for a null shape.
std::vector<int> NumbersOf(const TopoDS_Shape& shape, const FaceNumbers& numbers);

// Sentences for people: how many of `report`'s tolerances and dimensions XCAF found on the same
// faces, how many with the same width; by name those with another width, and those it has that the
// report has not. That it was not compared, if those of XCAF bind more than kMostBoundFaces.
std::vector<std::string> CompareWithXcaf(const Handle(TDocStd_Document) & document,
                                         const FaceNumbers& numbers, const ToleranceReport& report);

}  // namespace sightline
