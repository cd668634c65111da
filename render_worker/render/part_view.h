// SPDX-License-Identifier: Apache-2.0
// Geometry of a part's frame, and conversion of light transport's radiances to the sensor.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "render_worker/effects/effect.h"
#include "render_worker/render/part_scene.h"

namespace sightline {

// INVALID_ARGUMENT: an effect that acts on a flat plate alone, and would be silently ignored here.
absl::Status CheckEffectsActOnParts(const FrameSetup& nominal,
                                    std::span<const ActiveEffect> effects);

// Rig and measurement with the errors of distance and angle that effects put into the frame.
struct TrueGeometry {
  Rig rig;
  Measurement measurement;
};
TrueGeometry WithGeometryErrors(const Rig& rig, const Measurement& measurement,
                                const FrameSetup& nominal, const FrameSetup& frame);

// Camera and laser in part coordinates with the stage there.
SceneView MakeView(const PartScene& scene, const TrueGeometry& truth, const FrameSetup& frame,
                   double stage_position_m);

// How light is traced for a frame, by the inspection's render settings.
TransportSettings TransportSettingsOf(const RenderSettings& render, const FrameSetup& frame,
                                      int threads);

// The frame's region with one sample for `step` x `step` pixels, for a coarse look.
SubPixelGrid CoarseGrid(const FrameSetup& frame, int step);

// Motion of a point at the rig's origin in the image [m] while the stage travels.
Eigen::Vector2d ImageMotion(const TrueGeometry& truth, const FrameSetup& frame, double travel_m);

// Irradiance over radiance, E = pi/4 L T (D/b)^2 cos^4(phi) (thesis eq. 4.11 with D/b).
class IrradianceFactor {
 public:
  // `chief_distance_m`: image distance of the chief rays, SceneView::image_distance_m.
  IrradianceFactor(const FrameSetup& frame, double chief_distance_m);
  double operator()(double u_m, double v_m) const;

 private:
  double on_axis_, b2_;
};

// Mean wavelength [m] of the electrons that a channel releases; `fallback_m` where there are none.
double MeanWavelength(const Spectrum& light, const Spectrum& weight, double fallback_m);

// Materials whose measurement does not fit the size of the pixels on the part.
std::vector<std::string> ScaleWarnings(const PartScene& scene, const FrameSetup& frame);

}  // namespace sightline
