// SPDX-License-Identifier: Apache-2.0
// The exposure times that show the laser line on a facet of a material.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "core/detectability/detectability.h"
#include "core/inspection/inspection.h"
#include "render_worker/detectability/facet.h"
#include "render_worker/effects/effect.h"
#include "render_worker/material/material.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/render/part_scene.h"

namespace sightline {

// A facet of the material in the inspection's rig, wide enough for cameras up to
// `farthest_camera_m` away, with a laser that stays at `laser_distance_m` and the lens at
// `f_number`. Lamps are left out, because how a facet stands to them is not known; uniform ambient
// light stays. Errors of PartScene::Make.
absl::StatusOr<std::unique_ptr<PartScene>> MakeFacetScene(const Inspection& inspection,
                                                          const v1::Material& material,
                                                          double laser_distance_m,
                                                          double farthest_camera_m, double f_number,
                                                          const AssetResolver& assets);

// `scene`: of MakeFacetScene; may be shared by threads. The lens is focused on the facet. Infinite
// times if no exposure up to kLongestTried_s shows the line. CANCELLED, and errors of the chain.
absl::StatusOr<ExposureRange> FacetExposures(PartScene& scene,
                                             std::span<const ActiveEffect> effects,
                                             const FacetView& view, double min_detected_fraction,
                                             uint64_t seed, const RenderLimits& limits);

}  // namespace sightline
