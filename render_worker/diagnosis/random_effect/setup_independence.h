// SPDX-License-Identifier: Apache-2.0
// Whether what recordings are said to have drawn by chance follows how they were taken.
#pragma once

#include <cstdint>
#include <span>

#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// Probability that draws which do not depend on the set-up show a dependence on it as strong as
// `drawn` (of every recording of `set`; recordings without laser light do not count). A draw has
// mean 0 whatever the exposure time, f-number, distances and time of the recording, so a law of
// chance cannot be the physics of what follows them. Plate positions are the units, each with the
// mean of its recordings; the statistic is the largest over the quantities of the set-up of
// Kruskal and Wallis's H among their values (J. Am. Stat. Assoc. 47 (1952) 583), as its p-value by
// the chi squared law, referred to 20 000 permutations of the positions, so that the choice among
// quantities is paid for (Westfall and Young, Resampling-Based Multiple Testing (1993)). 1 where
// fewer than 6 positions or no quantity with two values are there.
double SetupIndependencePValue(const RecordedSet& set, std::span<const double> drawn,
                               uint64_t seed);

}  // namespace sightline
