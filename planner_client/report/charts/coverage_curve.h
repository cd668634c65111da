// SPDX-License-Identifier: Apache-2.0
// The coverage curve as a drawing.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace sightline {

struct CoverageCurve {
  std::vector<double> coverage;  // after scan 1, 2, ..., fraction of the measurable targets
  double goal = 0;               // fraction; 0: none drawn
  double bound_scans = 0;        // fewest scans for the goal; 0: none drawn
  bool bound_converged = false;
  // For those who do not see the drawing; along the ordinate.
  std::string title = "Coverage after each scan";
  std::string axis = "measured, % of the measurable surface";
  // A second line that is nowhere below `coverage`, of the same length; empty: none. With it, both
  // lines are named.
  std::vector<double> upper = {};
  std::string coverage_name = {}, upper_name = {};
  // The last value again, on targets that the search has not seen.
  std::optional<double> fresh = {};
};

// Number of scans at the end of the abscissa: of the curve's, or of its bound where that is more.
int CoverageCurveLastScan(const CoverageCurve& curve);

// An <svg> element, coloured by the page's CSS variables.
std::string CoverageCurveSvg(const CoverageCurve& curve);

}  // namespace sightline
