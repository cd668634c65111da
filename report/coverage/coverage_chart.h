// SPDX-License-Identifier: Apache-2.0
// Chart of the surface fraction that a plan has measured after each of its scans.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sightline/v1/report.pb.h"

namespace sightline {

struct CoverageCurve {
  std::vector<double> coverage;  // after scan 1, 2, ..., fraction of the targets that count
  double goal = 0;               // fraction; 0: none drawn
  double bound_scans = 0;        // fewest scans for the goal; 0: none drawn
  bool bound_converged = false;
  std::string title, axis, coverage_name;
  // A second line, at no point below `coverage`, of the same length; empty: none.
  std::vector<double> upper = {};
  std::string upper_name = {};
  // The last value on validation targets, which the search has not seen.
  std::optional<double> fresh = {};
};

// Values in per cent over the number of scans.
v1::ReportChart CoverageChart(const CoverageCurve& curve);

}  // namespace sightline
