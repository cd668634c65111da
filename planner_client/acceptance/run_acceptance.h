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
  // True if the file states `uncertainty.line_detection`; else the images determine the prediction.
  bool detection_stated = false;
  // If unset, nothing is rendered: detection errors are sampled from the inspection's model.
  std::optional<ArtefactImaging> imaging;
  int realisations = 4;  // of speckle and noise in every rendered frame; at least 1
  std::string context;   // starts every error message
};

// `client` is only used with `imaging`. Errors of ChooseArtefacts, ExposureOf and RenderLine;
// FAILED_PRECONDITION if the points of an artefact do not determine its surface.
absl::StatusOr<v1::AcceptanceResult> RunAcceptance(const AcceptanceTask& task,
                                                   const RenderClientOptions& client);

}  // namespace sightline
