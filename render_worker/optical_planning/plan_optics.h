// SPDX-License-Identifier: Apache-2.0
// Chooses settings for a frame, a scan or a whole plan, from the requested frames to the answer.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/render/part_scene.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

struct OpticsTask {
  struct Frame {
    PartFrameRequest request;
    int scan = 1;   // number in its plan
    int frame = 0;  // in its scan
  };
  std::vector<Frame> frames;  // at least one
  // Also choose a setting for each scan; a single scan has one setting in any case.
  bool per_scan = false;
  uint64_t seed = 1;
};

struct OpticsHooks {
  RenderLimits limits;  // its progress callback is not used
  std::function<void(double fraction, const std::string& message)> on_progress;  // may be empty
};

// Some frames represent each scan (ChooseRepresentatives). Each is cut to the rows around its line
// if there are several frames or more than a million pixels. One setting is chosen for all scans
// from up to 16 frames, weighted by the length of line that they represent. With `per_scan` each
// scan also gets its own setting, among the f-numbers permitted for all. The inspection must have
// sensor, lens and optics. FAILED_PRECONDITION, reason NO_LINE: no frame shows the line; reason
// EXPOSURE_TOO_LONG; INVALID_ARGUMENT: effects for plates only; RESOURCE_EXHAUSTED; CANCELLED. The
// same task and seed give the same bytes for any number of threads.
absl::StatusOr<v1::OpticsPlan> PlanOptics(PartScene& scene, std::span<const ActiveEffect> effects,
                                          const OpticsTask& task, const OpticsHooks& hooks);

}  // namespace sightline
