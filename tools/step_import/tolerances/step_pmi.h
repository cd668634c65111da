// SPDX-License-Identifier: Apache-2.0
// Semantic PMI of a STEP file (ISO 10303-242; its parts also in AP203 and AP214): dimensions,
// geometric tolerances and datums, with the entities that they bind, read from the file's entities.
#pragma once

#include <cstdint>
#include <vector>

#include "core/tolerance/tolerance.h"
#include "tools/step_import/tolerances/part21.h"

namespace sightline {

// Entities of the shape that one tolerance or datum binds.
struct PmiBinding {
  // Identified items: ADVANCED_FACE, EDGE_CURVE, ..., each once, ascending.
  std::vector<int64_t> items;
  bool whole_part = false;
};

struct StepPmi {
  // Without faces: the entities bound by read[i], untoleranced[i] and datums[i] are in the lists
  // below at the same index.
  ToleranceReport report;
  std::vector<PmiBinding> read, untoleranced, datums;
};

// Everything that ISO 10303-47 and -242 call dimension, geometric tolerance or datum is counted,
// then read or listed with the reason why not; nothing in the file's values throws. Lengths are
// converted by the unit of each measure.
StepPmi ReadStepPmi(const Part21File& file);

}  // namespace sightline
