// SPDX-License-Identifier: Apache-2.0
// A second reading of a STEP file's tolerances, OpenCASCADE's own (XCAF), to compare with.
#pragma once

#include <Standard_Handle.hxx>
#include <TopoDS_Shape.hxx>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/tolerance/tolerance.h"

class TDocStd_Document;

namespace sightline {

// Numbers of the faces that share one underlying shape: one per place in the assembly.
using FaceNumbers = std::map<const TopoDS_TShape*, std::set<int>>;

// Of all faces of `shape`; empty for a null shape.
std::set<int> NumbersOf(const TopoDS_Shape& shape, const FaceNumbers& numbers);

// Sentences for people: how many of `report`'s tolerances and dimensions XCAF found on the same
// faces, how many with the same width; by name those with another width, and those it has that the
// report has not.
std::vector<std::string> CompareWithXcaf(const Handle(TDocStd_Document) & document,
                                         const FaceNumbers& numbers, const ToleranceReport& report);

}  // namespace sightline
