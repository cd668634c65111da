// SPDX-License-Identifier: Apache-2.0
// Deviations of the laser line on artefacts, from images of the render worker.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/acceptance/acceptance_settings.h"
#include "core/acceptance/artefact.h"
#include "core/acceptance/artefact_scan.h"
#include "core/acceptance/line_deviations.h"
#include "core/inspection/inspection.h"
#include "planner_client/render_client/render_client.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// Inputs of images of artefacts.
struct ArtefactImaging {
  // The inspection without its part: sensor and materials inline; the only material is that of the
  // artefacts.
  v1::Inspection message;
  std::vector<AssetFile> assets;  // files of the material
  Inspection inspection;
  Measurement place;
  std::string folder;  // for the images, which are removed again
  uint64_t seed = 1;
};

// The line on one artefact.
struct RenderedLine {
  LineDeviations deviations;
  int images = 0;
  // Points detected both with and without speckle, over all images with speckle. The total
  // deviation is the sum of both errors.
  struct Sample {
    double incidence_rad = 0;
    double systematic_px = 0;  // in the image without speckle
    double random_px = 0;
  };
  std::vector<Sample> samples;
  double found_fraction = 0;  // of the points that are visible by geometry
};

// Exposure time at which the brightest 5 % of the line in the middle of the scan reach 70 % of the
// sensor's full scale. FAILED_PRECONDITION if no exposure from 1 us to 1 s shows the line.
absl::StatusOr<double> ExposureOf(const RenderClientOptions& client, const ArtefactImaging& imaging,
                                  const Artefact& artefact, const ArtefactScan& scan);

// Renders up to `most_frames` evenly spread frames of the scan, once without speckle and with
// `realisations` random realisations of speckle and noise each, on crops around the line. Detects
// the line by the inspection's method. `scan` has the points of all columns.
absl::StatusOr<RenderedLine> RenderLine(const RenderClientOptions& client,
                                        const ArtefactImaging& imaging, const Artefact& artefact,
                                        const ArtefactScan& scan, double exposure_time_s,
                                        int most_frames, int realisations);

}  // namespace sightline
