// SPDX-License-Identifier: Apache-2.0
// Settings for a frame, a scan or a whole plan: from the frames asked for to the answer.
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
  // Also a setting of its own for every scan; with one scan there is one setting in any case.
  bool per_scan = false;
  uint64_t seed = 1;
};

struct OpticsHooks {
  RenderLimits limits;  // its progress is not called
  std::function<void(double fraction, const std::string& message)> on_progress;  // may be empty
};

// Every scan is represented by some of its frames (ChooseRepresentatives), each cut to the rows
// about its line if there is more than one frame, or more than a million pixels. One setting is
// chosen for all of them, by up to 16 frames together that count by the length of line they stand
// for; with `per_scan` every scan gets its own, among the f-numbers that do for all. The inspection
// has sensor, lens and optics. FAILED_PRECONDITION, reason NO_LINE: no frame shows the line; reason
// EXPOSURE_TOO_LONG; INVALID_ARGUMENT: effects for plates alone; RESOURCE_EXHAUSTED; CANCELLED.
// Same task and seed, same bytes, for any number of threads.
absl::StatusOr<v1::OpticsPlan> PlanOptics(PartScene& scene, std::span<const ActiveEffect> effects,
                                          const OpticsTask& task, const OpticsHooks& hooks);

}  // namespace sightline
