// SPDX-License-Identifier: Apache-2.0
// Description of a fitted model-discrepancy term for the answer.
#pragma once

#include <Eigen/Core>
#include <span>

#include "render_worker/effects/effect.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// The curve that fitted coefficients make, with its standard errors: response against signal, line
// spread against distance, power against time, ... Terms of several variables give their
// coefficients one after the other, named in `abscissa`. `covariance` of the coefficients, in their
// units; an empty matrix leaves the standard errors out. `term` must be one of FreeFormTerms(). The
// law in the set-up stays empty (setup_law.h).
v1::FreeFormTerm DescribeFreeForm(const Effect& term, std::span<const double> coefficients,
                                  const Eigen::MatrixXd& covariance);

}  // namespace sightline
