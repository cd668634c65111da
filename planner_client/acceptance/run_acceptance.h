// SPDX-License-Identifier: Apache-2.0
// The acceptance test of a rig: all artefacts, simulated and predicted.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/acceptance/acceptance_settings.h"
#include "core/inspection/inspection.h"
#include "planner_client/acceptance/rendered_line.h"
#include "planner_client/render_client/render_client.h"
#include "sightline/v1/acceptance.pb.h"

namespace sightline {

struct AcceptanceTask {
  Inspection inspection;
  AcceptanceSettings settings;
  // `uncertainty.line_detection` is in the file; else the prediction takes what images show.
  bool detection_stated = false;
  // Unset: nothing is rendered, detection errors are drawn from the inspection's line detection.
  std::optional<ArtefactImaging> imaging;
  int realisations = 4;  // of speckle and noise in every rendered frame; at least 1
  std::string context;   // starts every error message
};

// `client` is used with `imaging` only. Errors of ChooseArtefacts, ExposureOf and RenderLine;
// FAILED_PRECONDITION: points of an artefact do not determine its surface.
absl::StatusOr<v1::AcceptanceResult> RunAcceptance(const AcceptanceTask& task,
                                                   const RenderClientOptions& client);

}  // namespace sightline
