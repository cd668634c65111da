// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace sightline {

// How a surface is fitted to measured points (`tolerances.association`).
enum class Association {
  kGauss,      // least squares
  kChebyshev,  // smallest range of the signed distances: minimum zone
};

}  // namespace sightline
