// SPDX-License-Identifier: Apache-2.0
// Test whether realised values of a random effect depend on the set-up of the recordings.
#pragma once

#include <cstdint>
#include <span>

#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// P-value of the hypothesis that realised values are independent of the set-up. `drawn`: one value
// per recording of `set`; recordings without laser light do not count.
//
// A random effect has mean 0 whatever exposure time, f-number and distances a recording has. Values
// that depend on these have another cause. Plate positions are the units, each with the mean of its
// recordings. The statistic is Kruskal and Wallis's H (J. Am. Stat. Assoc. 47 (1952) 583) among the
// values of a quantity of the set-up, as its p-value by the chi squared distribution; the smallest
// over the quantities counts. 20 000 permutations of the positions give its distribution, which
// corrects for the choice among quantities (Westfall and Young, Resampling-Based Multiple Testing
// (1993)). The result is 1 if there are fewer than 6 positions or no quantity with two values.
double SetupIndependencePValue(const RecordedSet& set, std::span<const double> drawn,
                               uint64_t seed);

}  // namespace sightline
