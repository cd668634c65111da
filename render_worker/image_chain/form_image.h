// SPDX-License-Identifier: Apache-2.0
// The chain after light transport: ideal image -> optics -> sensor -> raw numbers, with effects.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "absl/status/statusor.h"
#include "render_worker/effects/effect.h"

namespace sightline {

struct FormedImage {
  Image<uint16_t> raw_dn;
  PixelIrradiance light;
  Image<double> mean_photo_electrons;  // after the effects, for the next frame of the burst
};

// The frame as the effects of the setup stage leave it.
FrameSetup ApplyFrameEffects(FrameSetup frame, std::span<const ActiveEffect> effects);

// Pupil, curvature and transfer functions of the frame, with the effects' changes. `frame` is the
// result of ApplyFrameEffects.
OpticsModel MakeOpticsModel(const FrameSetup& frame, std::span<const ActiveEffect> effects);

// Grid for the laser light. It has the sub-pixels that the pupil needs (or frame.sub_pixels, if
// more) and a margin beyond which the point spread at `largest_curvature_per_m` holds less than
// `lost_energy`. The margin is the range of scattered light; ApplyOptics needs none to prevent
// wrap-around.
SubPixelGrid MakeSubPixelGrid(const FrameSetup& frame, const OpticsModel& optics,
                              double largest_curvature_per_m, double lost_energy = 1e-3);

// Optics: from the ideal image to the pixels. `image`: after the effects on ideal images;
// `speckle`: as realised. INVALID_ARGUMENT if the grid is too coarse for the pupil.
absl::StatusOr<PixelIrradiance> FormLight(const IdealImage& image, const FrameSetup& frame,
                                          std::span<const ActiveEffect> effects,
                                          const SpeckleModel& speckle, int threads);

// Sensor: from light to raw values. `previous_mean_electrons`: of the preceding frame in the same
// burst, or nullptr.
struct ReadOutImage {
  Image<uint16_t> raw_dn;
  Image<double> mean_photo_electrons;  // after the effects
};
ReadOutImage ReadOut(const PixelIrradiance& light, const FrameSetup& frame,
                     std::span<const ActiveEffect> effects,
                     const Image<double>* previous_mean_electrons);

// The whole chain, effects on the ideal image included. Errors of FormLight.
absl::StatusOr<FormedImage> FormImage(IdealImage image, const FrameSetup& frame,
                                      std::span<const ActiveEffect> effects,
                                      const SpeckleModel& speckle,
                                      const Image<double>* previous_mean_electrons, int threads);

// Renders a plate, from scene to raw values. `make_scene`: returns the plate of a frame after
// ApplyFrameEffects and before the effects on plates.
absl::StatusOr<FormedImage> RenderPlateFrame(
    const FrameSetup& nominal, std::span<const ActiveEffect> effects,
    const Image<double>* previous_mean_electrons, int threads,
    const std::function<PlateScene(const FrameSetup&)>& make_scene = MakePlateScene);

}  // namespace sightline
