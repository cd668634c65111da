// SPDX-License-Identifier: Apache-2.0
// Geometry of a part's frame, and conversion of radiances from light transport to the sensor.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "render_worker/effects/effect.h"
#include "render_worker/render/part_scene.h"

namespace sightline {

// INVALID_ARGUMENT: an effect only acts on flat plates and would be silently ignored here.
absl::Status CheckEffectsActOnParts(const FrameSetup& nominal,
                                    std::span<const ActiveEffect> effects);

// Rig and measurement with the errors of distance and angle that effects set in the frame.
struct TrueGeometry {
  Rig rig;
  Measurement measurement;
};
TrueGeometry WithGeometryErrors(const Rig& rig, const Measurement& measurement,
                                const FrameSetup& nominal, const FrameSetup& frame);

// Camera and laser in part coordinates at a stage position.
SceneView MakeView(const PartScene& scene, const TrueGeometry& truth, const FrameSetup& frame,
                   double stage_position_m);

// Settings of light transport for a frame, from the inspection's render settings.
TransportSettings TransportSettingsOf(const RenderSettings& render, const FrameSetup& frame,
                                      int threads);

// The frame's region with one sample for `step` x `step` pixels, for a coarse evaluation.
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

// Mean wavelength [m] of the electrons that a channel releases; `fallback_m` if it releases none.
double MeanWavelength(const Spectrum& light, const Spectrum& weight, double fallback_m);

// Warnings about materials whose measurement does not suit the size of the pixels on the part.
std::vector<std::string> ScaleWarnings(const PartScene& scene, const FrameSetup& frame);

}  // namespace sightline
