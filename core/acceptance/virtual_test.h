// SPDX-License-Identifier: Apache-2.0
// Acceptance test of one artefact: simulated by draws of all errors, and predicted to first order
// by the uncertainty model that planning uses.
//
//   const ArtefactScan scan = ScanArtefact(rig, geometry, artefact, limits);
//   const auto simulated = SimulateTests(scan, artefact, model, &deviations, 400, seed);
//   const ArtefactPrediction predicted = PredictTests(scan, artefact, model, 400, seed);
//
// A run draws the errors of calibration once (the sensors keep their place) and those of detection
// for every point; of a hole pattern in either set-up anew. The true image position is where the
// true sheet and line of sight meet the artefact; the measured point is triangulated from the
// detected position with the nominal setup. Nothing is linearised there.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/acceptance/artefact.h"
#include "core/acceptance/artefact_fit.h"
#include "core/acceptance/artefact_scan.h"
#include "core/acceptance/line_deviations.h"
#include "core/uncertainty/uncertainty_model.h"

namespace sightline {

// Errors of one quantity, a number per run [m]. Runs without a fit are left out.
using SimulatedErrors = std::vector<std::vector<double>>;  // [quantity][run]

// `deviations`: of rendered images, drawn a line at a time; null: detection errors are drawn from
// the model, along rows and columns of the image. Same seed, same numbers.
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

// In the order of AcceptanceQuantities() of the artefact's kind. Form errors: by `draws` draws of
// the linear model.
std::vector<QuantityPrediction> PredictTests(const ArtefactScan& scan, const Artefact& artefact,
                                             const UncertaintyModel& model, int draws,
                                             uint64_t seed);

// Contribution to every quantity of the mean deviation of the detected line, which no uncertainty
// model has.
std::vector<double> SystematicContributions(const ArtefactScan& scan, const Artefact& artefact,
                                            const LineDeviations& deviations);

// Standard uncertainty of sizes and distances that the finite number of rendered lines leaves: all
// tests draw from the same lines, whose mean is that of the line only within chance. Standard error
// of the mean over the realisations; 0 of form errors, and with a single realisation.
std::vector<double> ChanceOfRenderedLines(const ArtefactScan& scan, const Artefact& artefact,
                                          const LineDeviations& deviations);

// The 95 % quantile of the magnitudes. At least one value.
double Magnitude95(std::vector<double> errors_m);

// Stage position and column of the reference place of a surface, which deviations are relative to.
struct ReferencePlace {
  double stage_m = 0;
  int column_px = 0;
};
ReferencePlace PlaceOfReference(const ArtefactScan& scan, const ArtefactSurface& surface);

}  // namespace sightline
