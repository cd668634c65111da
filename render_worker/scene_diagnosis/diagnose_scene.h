// SPDX-License-Identifier: Apache-2.0
// Diagnosis of recordings of a part: the light that the nominal model lacks, its location, and the
// probability of each explanation (docs/diagnosis.md).
//
// The expected images are separated by light path (light_paths.h), reduced to means over blocks of
// pixels (block/block_means.h), and fitted (fit/path_fit.h). The null model, the null model with
// one or two further light paths, and with a smooth map of unknown origin are then compared
// (fit/compare_paths.h).
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
  int block_px = 8;              // pixels on a side of the blocks whose means are compared
  int tile_blocks = 4;           // blocks on a side of the tiles that are held out in turn
  double registration_px = 0.3;  // standard uncertainty of the position of the model's image
  int max_bounces = 4;           // reflections of light that the null model lacks
  std::vector<std::string> excluded_effects = {};  // ids, of LeftOutEffects()
  int max_effects = 2;                             // of one hypothesis; 1 or 2
  int64_t max_image_bytes = int64_t{8} << 30;
  const std::atomic<bool>* cancelled = nullptr;
};

// Gets the fraction done, in [0, 1], and the next step.
using SceneDiagnosisProgress = std::function<void(double fraction, std::string_view what)>;

// `progress` may be empty. Verdicts: "effect", with light path, region in the images and surface;
// "none"; "interrupted". Light of unknown origin is the effect "unknown". `calibrated`: the
// description with the fitted factors. The same inputs give the same bytes for any number of
// threads.
//
// If cancelled after a recording with laser light has been traced, the verdict is
// "interrupted", the answer covers the traced recordings, and `calibrated` is unset; if
// cancelled earlier, CANCELLED. INVALID_ARGUMENT: images that do not match the
// description (count, size, values above the sensor's largest), max_effects out of
// range; FAILED_PRECONDITION: no recording with the laser on; errors of
// RenderPartFrame.
absl::StatusOr<v1::Diagnosis> DiagnoseScene(const RecordedScene& scene,
                                            const SceneDiagnosisSettings& settings,
                                            const SceneDiagnosisProgress& progress);

}  // namespace sightline
