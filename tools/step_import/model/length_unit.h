// SPDX-License-Identifier: Apache-2.0
// The length unit of a STEP file's geometry. A file need not state one: its representation contexts
// then have no GLOBAL_UNIT_ASSIGNED_CONTEXT, or one without a length. OpenCASCADE takes such
// lengths for millimetres without a word; here they are an error unless the caller states the unit.
// It also takes a damaged SI_UNIT for metres, and one of two units: the units that apply are
// therefore read from the file's own entities, and OpenCASCADE's are compared with them.
#pragma once

#include <Interface_InterfaceModel.hxx>
#include <StepRepr_Representation.hxx>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/step_import/tolerances/part21.h"

namespace sightline {

struct ContextLengthUnit {
  std::string name;  // in lower case: "millimetre", "inch"
  double metres = 0;
  std::vector<int64_t> ids;  // of the instances that state it, at least one
};

// The length unit of a representation context; none if it states none. Throws StepInputError naming
// the file and the instance if a unit is missing or damaged, is no metre, has no factor > 0, has a
// name that its factor contradicts or a chain of more than eight conversions, or if two length
// units differ.
std::optional<ContextLengthUnit> LengthUnitOfContext(const Part21File& file, int64_t context);

// Length units of all contexts of the file, by their names: "millimetre", "inch, millimetre"; empty
// if there are none.
std::string StatedLengthUnits(const Handle(Interface_InterfaceModel) & model);

// Gives `unit` (core/text/length_unit.h) to the contexts of those representations that
// state none, and the unit that they state to those where OpenCASCADE takes another. Throws
// StepInputError naming the file if some state none and `unit` is empty, if all state one and
// `unit` is given, if `unit` is unknown, or as LengthUnitOfContext for any context of geometry.
void SettleLengthUnit(const Part21File& file, const std::string& unit,
                      const Handle(Interface_InterfaceModel) & model,
                      const std::vector<Handle(StepRepr_Representation)>& representations);

// Millimetres in one unit of that name; 0 if it is unknown.
double MillimetresPer(const std::string& unit);

// Refusals: the file states no unit and none is given; it states `stated` and another is given.
[[noreturn]] void FailWithoutLengthUnit(const std::string& name);
[[noreturn]] void FailWithSecondLengthUnit(const std::string& name, const std::string& stated);

}  // namespace sightline
