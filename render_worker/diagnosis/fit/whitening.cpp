// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/whitening.h"

#include <cassert>

namespace sightline {

Whitening::Whitening(const std::vector<Eigen::MatrixXd>& covariance,
                     const BlockVectors& unexplained) {
  factors_.resize(covariance.size());
  for (size_t e = 0; e < covariance.size(); ++e) {
    Eigen::MatrixXd sum = covariance[e];
    if (!unexplained.empty()) sum.diagonal() += unexplained[e].cwiseAbs2();
    factors_[e].compute(sum);
    assert(factors_[e].info() == Eigen::Success);
  }
}

}  // namespace sightline
