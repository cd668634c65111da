// SPDX-License-Identifier: Apache-2.0
// Semantic PMI of a STEP file (ISO 10303-242; its parts also in AP203 and AP214): dimensions,
// geometric tolerances and datums, with the entities that they bind, read from the file's entities.
#pragma once

#include <cstddef>
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

// Entities may refer to the same others as often as they like, so that a short file could ask for
// any amount of memory and time. Counted are the bytes of an entity each time that it is looked at,
// and kBytesOfLink for everything that an aspect consists of, each time that a tolerance or datum
// leads there: some seconds, and a few times as many bytes. Some 2000 bytes belong to a tolerance
// of an ordinary file, so that this is enough for 50 000 of them.
inline constexpr size_t kMostWork = 100'000'000;
// Memory per link: its number here, and that of its face in the report, its message and JSON.
inline constexpr size_t kBytesOfLink = 64;
// Most entities of the shape, other than faces, that are named for each tolerance or datum.
inline constexpr size_t kEntitiesNamed = 16;

struct StepPmi {
  // Without faces: the entities bound by read[i], untoleranced[i] and datums[i] are in the lists
  // below at the same index.
  ToleranceReport report;
  std::vector<PmiBinding> read, untoleranced, datums;
  size_t work = 0;  // of kMostWork
};

// Everything that ISO 10303-47 and -242 call dimension, geometric tolerance or datum is counted,
// then read or listed with the reason why not; nothing in the file's values throws. Lengths are
// converted by the unit of each measure. Throws StepInputError naming file and entity if the
// entities refer to each other so often that there is more than kMostWork to do.
StepPmi ReadStepPmi(const Part21File& file);

}  // namespace sightline
