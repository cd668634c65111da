// SPDX-License-Identifier: Apache-2.0
// A small made-up plan for uncertainty.
#pragma once

#include "report/plan/report.h"

namespace sightline {

// A square plate of 10 x 10 targets, 5 mm apart; target i in column i % 10. Scan 1 covers columns 0
// to 4, scan 2 columns 3 to 7; 8 and 9 stay at the prior of 10 mm. Tolerances bind columns 1 to 9
// (admissible 50 um); target 1 is not measurable. Relaxed: 1 mm. Parts [um] of covered columns:
//   0      noise 4, sampling 3, calibration 0:  no tolerance
//   1, 2   noise 30, sampling 0, calibration 40: u is exactly the admissible 50
//   3, 4   noise 60: relaxed, noise; of column 3 by a quarter of the points that the others have
//   5, 6   calibration 80, noise 60: relaxed, calibration
//   7      sampling 2000: not reached, sampling
// Judged are 9 columns of 10 targets without target 1; five features.
ReportData SampleUncertaintyPlan();

}  // namespace sightline
