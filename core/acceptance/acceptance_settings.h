// SPDX-License-Identifier: Apache-2.0
// `acceptance` of an inspection as validated values, the position of the sensors, and the artefacts
// that fit into their field.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/acceptance/artefact.h"
#include "core/acceptance/artefact_fit.h"
#include "core/acceptance/artefact_scan.h"
#include "core/inspection/inspection.h"
#include "sightline/v1/acceptance.pb.h"

namespace sightline {

struct PermittedError {
  AcceptanceQuantityKind kind;
  double permitted_m = 0;
};

struct AcceptanceSettings {
  // Unset: derived from the size of the field.
  std::optional<double> sphere_diameter_m, ball_bar_length_m, plate_side_m, ring_diameter_m;
  std::vector<PermittedError> limits;
  std::optional<Measurement> place;
  int runs = 200;
  uint64_t seed = 1;
  std::optional<double> exposure_time_s;
};

// INVALID_ARGUMENT names `context`, field, value and what is allowed; an unknown quantity with the
// nearest known one.
absl::StatusOr<AcceptanceSettings> ParseAcceptance(const v1::Acceptance& message,
                                                   const std::string& context);

// The stated position; else the position of the domain nearest to 0.4 m, 30 degrees, azimuth 0,
// with camera and laser at equal angles to the vertical.
Measurement PlaceOfSensors(const AcceptanceSettings& settings, const MeasurementDomain& domain);

// Width of the field along the laser line, at the point where camera and laser meet [m].
double FieldWidth(const Rig& rig, const Measurement& place);

struct ArtefactChoice {
  std::vector<Artefact> artefacts;
  std::vector<std::string> warnings;  // a ball bar that cannot be inclined, a pattern too large
};

// INVALID_ARGUMENT names `context` and the field: an artefact of the stated size does not fit into
// the field of view, no artefact fits, or the sheet contains the direction of the stage.
absl::StatusOr<ArtefactChoice> ChooseArtefacts(const AcceptanceSettings& settings, const Rig& rig,
                                               const ScanGeometry& geometry,
                                               const SightLimits& limits,
                                               const std::string& context);

}  // namespace sightline
