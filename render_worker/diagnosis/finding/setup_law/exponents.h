// SPDX-License-Identifier: Apache-2.0
// Free fit of the exponents of a dependence on the set-up.
#pragma once

#include <vector>

#include "render_worker/diagnosis/finding/setup_law/search.h"

namespace sightline::setup_law {

// Elements in the order of the form's powers.
struct Exponents {
  std::vector<double> values, standard_errors;
};
// Gauss-Newton fit of amplitude, constant and exponents, with the weights of the robust fit.
Exponents FitExponents(const LawSearch& search, const Standardised& data,
                       const LawSearch::Found& found);

}  // namespace sightline::setup_law
