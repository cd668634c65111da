// The coverage curve as a drawing.
#pragma once

#include <string>
#include <vector>

namespace sightline {

struct CoverageCurve {
  std::vector<double> coverage;  // after scan 1, 2, ..., fraction of the measurable targets
  double goal = 0;               // fraction; 0: none drawn
  double bound_scans = 0;        // fewest scans for the goal; 0: none drawn
  bool bound_converged = false;
};

// An <svg> element, coloured by the page's CSS variables.
std::string CoverageCurveSvg(const CoverageCurve& curve);

}  // namespace sightline
