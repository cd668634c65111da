// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms: one for each way in which a stage of the chain could differ from its
// model, with a few coefficients in which the image is linear near 0. They stand for physics that
// the vocabulary lacks.
//
// They are effects like those of the vocabulary (fitted, rendered, ordered the same way), but not
// registered in it: an inspection cannot name them.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string_view>

#include "render_worker/effects/effect.h"
#include "render_worker/effects/stage_name.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// All terms, in the order in which they act if several are used. Ids are "unknown.response", ...
// Null is 0 for every coefficient.
std::span<const Effect* const> FreeFormTerms();
// nullptr: there is none of that id.
const Effect* FindFreeFormTerm(std::string_view id);

// The curve that fitted coefficients make, with its standard errors: response against signal, line
// spread against distance, power against time, ... Terms of several variables give their
// coefficients one after the other, named in `abscissa`. `covariance` of the coefficients, in their
// units; an empty matrix leaves the standard errors out. `term` must be one of FreeFormTerms(). The
// law in the set-up stays empty (setup_law.h).
v1::FreeFormTerm DescribeFreeForm(const Effect& term, std::span<const double> coefficients,
                                  const Eigen::MatrixXd& covariance);

}  // namespace sightline
