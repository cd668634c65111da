// SPDX-License-Identifier: Apache-2.0
// Damage that OpenCASCADE reads over, or that ends it.
#pragma once

#include <Interface_Graph.hxx>
#include <string>
#include <vector>

#include "tools/step_import/model/part_items.h"
#include "tools/step_import/tolerances/part21.h"

namespace sightline {

// OpenCASCADE skips what it cannot read and carries on. Annotations it does not know do no harm,
// but a body with a lost edge must not pass for a part. Throws StepInputError naming the entity.
void RequireIntactGeometry(const std::string& name, const Interface_Graph& graph);

// Points and directions of the part, its construction geometry and its placements must have three
// coordinates, except those of curves in the parameter space of a surface (PCURVE). OpenCASCADE
// reads the missing one from beyond the array. No point and no direction of the file may have more
// than three, which OpenCASCADE would leave out. Throws StepInputError naming the entity.
void RequireThreeCoordinates(const Part21File& file, const Interface_Graph& graph,
                             const PartItems& items);

}  // namespace sightline
