// SPDX-License-Identifier: Apache-2.0
// Tables of the exposure times with which the laser line is detected on a material, from rendered
// images of a facet.
//
// At every point of the grid (camera distance, incidence of camera and laser, azimuth between them)
// a flat facet of the material is put there with the laser line on it. Its light goes through the
// chain of optical planning: lens, speckle, sensor, line detection. The facet is in focus, since
// defocus is a limit of its own; a plane has no multiple reflections. Machining marks are
// turned by 45 degrees from the plane of normal and camera.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "render_worker/effects/effect.h"
#include "render_worker/material/material.h"
#include "render_worker/render/part_frame.h"
#include "sightline/v1/detectability.pb.h"

namespace sightline {

struct DetectabilityTask {
  // Material names of the part file that need a table; the empty name is every other surface.
  std::vector<std::string> part_materials;
  double f_number = 0;
  double min_detected_fraction = 0.9;
  uint64_t seed = 1;
};

struct DetectabilityHooks {
  RenderLimits limits;  // its progress is not called
  std::function<void(double fraction, const std::string& message)> on_progress;  // may be empty
};

// Angles of the grid [deg]. Near the mirror direction the azimuth is finer.
inline constexpr double kFacetIncidence_deg[] = {0, 20, 40, 55, 70, 80, 87};
inline constexpr double kFacetAzimuth_deg[] = {0, 60, 120, 155, 180};

// `inspection` has sensor, lens, optics and materials; camera distances are the ends of its domain.
// INVALID_ARGUMENT: a name without a material, an effect of plates alone, or an error of
// PartScene::Make; CANCELLED. Same task
// and seed, same bytes, for any number of threads.
absl::StatusOr<v1::DetectabilityTable> MakeDetectabilityTable(const Inspection& inspection,
                                                              std::span<const ActiveEffect> effects,
                                                              const AssetResolver& assets,
                                                              const DetectabilityTask& task,
                                                              const DetectabilityHooks& hooks);

}  // namespace sightline
