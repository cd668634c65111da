// SPDX-License-Identifier: Apache-2.0
// Exponents of a law, fitted freely.
#pragma once

#include <vector>

#include "render_worker/diagnosis/finding/setup_law/search.h"

namespace sightline::setup_law {

// In the order of the form's powers.
struct Exponents {
  std::vector<double> values, standard_errors;
};
// Gauss and Newton on amplitude, constant and exponents, with the weights of the robust fit.
Exponents FitExponents(const LawSearch& search, const Standardised& data,
                       const LawSearch::Found& found);

}  // namespace sightline::setup_law
