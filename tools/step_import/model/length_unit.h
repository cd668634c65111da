// SPDX-License-Identifier: Apache-2.0
// The length unit of a STEP file's geometry. A file need not state one: its representation contexts
// then have no GLOBAL_UNIT_ASSIGNED_CONTEXT, or one without a length. OpenCASCADE takes such
// lengths for millimetres without a word; here they are an error unless the caller states the unit.
#pragma once

#include <Interface_InterfaceModel.hxx>
#include <StepRepr_Representation.hxx>
#include <string>
#include <vector>

namespace sightline {

// Length units of all contexts of the file, by their names: "millimetre", "inch, millimetre"; empty
// if there are none.
std::string StatedLengthUnits(const Handle(Interface_InterfaceModel) & model);

// Gives `unit` (core/text/length_unit.h) to the contexts of those representations that
// state none. Throws StepInputError naming the file `name` if some state none and `unit` is empty,
// if all state one and `unit` is given, or if `unit` is unknown.
void SettleLengthUnit(const std::string& name, const std::string& unit,
                      const Handle(Interface_InterfaceModel) & model,
                      const std::vector<Handle(StepRepr_Representation)>& representations);

// Millimetres in one unit of that name; 0 if it is unknown.
double MillimetresPer(const std::string& unit);

// Refusals: the file states no unit and none is given; it states `stated` and another is given.
[[noreturn]] void FailWithoutLengthUnit(const std::string& name);
[[noreturn]] void FailWithSecondLengthUnit(const std::string& name, const std::string& stated);

}  // namespace sightline
