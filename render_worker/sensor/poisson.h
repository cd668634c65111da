// SPDX-License-Identifier: Apache-2.0
// Exact Poisson random numbers of any mean, from a counter-based stream.
#pragma once

#include "core/random/counter_random.h"

namespace sightline {

// ln(k!), k >= 0; relative error below 1e-14.
double LogFactorial(double k);

// A Poisson number of `mean` (>= 0, up to 1e9): inversion by sequential search below a mean of 10,
// transformed rejection with squeeze (PTRS, Hoermann 1993, Insurance: Mathematics and Economics 12)
// above. Exact up to the 32 bits of the uniform numbers.
double PoissonNumber(double mean, CounterRandom& random);

}  // namespace sightline
