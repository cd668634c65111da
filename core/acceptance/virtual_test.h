// SPDX-License-Identifier: Apache-2.0
// Acceptance test of one artefact: simulated by draws of all errors, and predicted to first order
// by the uncertainty model that planning uses.
//
//   const ArtefactScan scan = ScanArtefact(rig, geometry, artefact, limits);
//   const auto simulated = SimulateTests(scan, artefact, model, &deviations, 400, seed);
//   const ColumnDetection columns{LineShifts(scan, artefact, rig.laser, method)};
//   const auto predicted = PredictTests(scan, artefact, model, &columns, 400, seed);
//
// A run draws the errors of calibration once, because the sensors do not move, and those of
// detection for every point (for a hole pattern, in each set-up). The true image position is that
// at which the true sheet and line of sight meet the artefact. The measured point is triangulated
// from the detected position with the nominal setup, without linearisation.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/acceptance/artefact.h"
#include "core/acceptance/artefact_fit.h"
#include "core/acceptance/artefact_scan.h"
#include "core/acceptance/line_deviations.h"
#include "core/laser_line/detect_laser_line.h"
#include "core/rig/rig.h"
#include "core/uncertainty/uncertainty_model.h"

namespace sightline {

// Errors of one quantity, a number per run [m]. Runs without a fit are left out.
using SimulatedErrors = std::vector<std::vector<double>>;  // [quantity][run]

// `deviations`: deviations in rendered images, of which whole lines are drawn; null: detection
// errors along rows and columns are drawn from the model. The same seed gives the same numbers.
SimulatedErrors SimulateTests(const ArtefactScan& scan, const Artefact& artefact,
                              const UncertaintyModel& model, const LineDeviations* deviations,
                              int runs, uint64_t seed);

struct ErrorTerm {
  std::string name;
  // Standard uncertainty of a size or distance; of a form error, root mean square over the points.
  double contribution_m = 0;
};

struct QuantityPrediction {
  double magnitude_m = 0;  // that 95 % of the tests do not exceed
  std::vector<ErrorTerm> terms;
};

// Systematic error of line detection at every point, because the laser sheet has a width and the
// surface a curvature [px] (core/triangulation/line_shift.h).
std::vector<double> LineShifts(const ArtefactScan& scan, const Artefact& artefact,
                               const Laser& laser, LaserLineMethod method);

// Line detection by columns of rendered images, which finds the row in a column: points have no
// error along the rows of the image.
struct ColumnDetection {
  // Systematic errors that are not corrected, one per point of the scan [px].
  std::vector<double> shifts_px;
};

// In the order of AcceptanceQuantities() of the artefact's kind. Form errors: by `draws` draws of
// the linear model. `columns`: null has the model's detection error along rows and along columns,
// without systematic errors. A size or distance has an error of the normal distribution N(b, u): u
// is its standard uncertainty, b the effect of the systematic errors and the bias of least squares
// by noise (LinearFit::MeanChange). Its magnitude m satisfies P(|error| <= m) = 95 % (cf. GUM
// F.2.4.5).
std::vector<QuantityPrediction> PredictTests(const ArtefactScan& scan, const Artefact& artefact,
                                             const UncertaintyModel& model,
                                             const ColumnDetection* columns, int draws,
                                             uint64_t seed);

// The m with P(|X| <= m) = 95 % for X of N(mean, deviation), deviation >= 0.
double NormalMagnitude95(double mean, double deviation);

// Contribution of systematic errors of line detection (one per point [px]) to every quantity.
std::vector<double> SystematicContributions(const ArtefactScan& scan, const Artefact& artefact,
                                            std::span<const double> shifts_px);

// Systematic errors of the rendered line at every point [px].
std::vector<double> RenderedShifts(const ArtefactScan& scan, const Artefact& artefact,
                                   const LineDeviations& deviations);

// Removes points that rendered lines never show, such as those in columns of a colour other than
// the laser's.
void KeepRendered(const Artefact& artefact, const LineDeviations& deviations, ArtefactScan* scan);

// The 95 % quantile of the magnitudes. At least one value.
double Magnitude95(std::vector<double> errors_m);

// Stage position and column of the reference position of a surface, to which deviations refer.
struct ReferencePlace {
  double stage_m = 0;
  int column_px = 0;
};
ReferencePlace PlaceOfReference(const ArtefactScan& scan, const ArtefactSurface& surface);

}  // namespace sightline
