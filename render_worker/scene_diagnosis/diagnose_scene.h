// SPDX-License-Identifier: Apache-2.0
// From recordings of a part to the light its nominal model leaves out (docs/diagnosis.md).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

struct SceneDiagnosisSettings {
  uint64_t seed = 1;  // of light transport
  int threads = 2;
  int block_px = 8;              // blocks of which means are compared
  int tile_blocks = 4;           // blocks on a side of the tiles that are held out in turn
  double registration_px = 0.3;  // standard uncertainty of where the model's image lies
  int max_bounces = 4;           // of light that the null model leaves out
  std::vector<std::string> excluded_effects = {};  // not to be considered, by id
  int max_effects = 2;                             // at once; 1 or 2
  int64_t max_image_bytes = int64_t{8} << 30;
  const std::atomic<bool>* cancelled = nullptr;
};

// Fraction done and what is being done.
using SceneDiagnosisProgress = std::function<void(double, std::string_view)>;

// Takes the expected image apart by the ways light can take (TraceLightPaths), fits the factors of
// the null model's paths within their uncertainties, then with each path that it leaves out, with
// two of them, and with a free smooth map. These compete by evidence on half of the image's tiles
// and predictive density on the other half. Verdict "effect" names path, place in the images and
// surface; "unknown": the map is better than every path; "none". `calibrated`: the description with
// the fitted factors. The same inputs give the same bytes for any number of threads. Cancelled once
// the light of a recording has been traced: verdict "interrupted" with what can be said by then, of
// the recordings that were traced, and without `calibrated`; earlier: CANCELLED.
// INVALID_ARGUMENT: images that do not match the description (count, size, numbers above the
// sensor's largest); FAILED_PRECONDITION: no recording with the laser on; errors of
// RenderPartFrame.
absl::StatusOr<v1::Diagnosis> DiagnoseScene(const RecordedScene& scene,
                                            const SceneDiagnosisSettings& settings,
                                            const SceneDiagnosisProgress& progress);

}  // namespace sightline
