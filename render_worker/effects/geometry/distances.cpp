// SPDX-License-Identifier: Apache-2.0
// Distances and angle of the plate's set-up beyond their uncertainty.
#include <numbers>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr const char* kTriangulationReference = "thesis eq. 1.1-1.5 (triangulation)";

class CameraDistanceErrorEffect final : public DescribedEffect {
 public:
  CameraDistanceErrorEffect()
      : DescribedEffect({.id = "geometry.camera_distance_error",
                         .stage = Stage::kGeometry,
                         .signature = {{"line_core", "line_position"}, {"camera_distance_m"}},
                         .scope = EffectScope::kRecordingSetUp,
                         .summary = "camera farther from the plate than stated, focus as set",
                         .reference = kTriangulationReference,
                         .parameters = {{"camera_distance_shift_m", 0, -0.1, 0.1, 5e-3}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.plate.camera_distance_m += p[0];
  }
};

class LaserDistanceErrorEffect final : public DescribedEffect {
 public:
  LaserDistanceErrorEffect()
      : DescribedEffect({.id = "geometry.laser_distance_error",
                         .stage = Stage::kGeometry,
                         .signature = {{"line_core", "line_flanks"}, {"laser_distance_m"}},
                         .scope = EffectScope::kRecordingSetUp,
                         .summary = "projector farther from the plate than stated",
                         .reference = kTriangulationReference,
                         .parameters = {{"laser_distance_shift_m", 0, -0.1, 0.1, 1e-2}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.plate.laser_distance_m += p[0];
  }
};

class IncidenceAngleErrorEffect final : public DescribedEffect {
 public:
  IncidenceAngleErrorEffect()
      : DescribedEffect({.id = "geometry.incidence_angle_error",
                         .stage = Stage::kGeometry,
                         .signature = {{"line_core", "whole_image"}, {"signal_level"}},
                         .scope = EffectScope::kRecordingSetUp,
                         .summary = "angle between sheet and plate normal not as stated",
                         .reference = kTriangulationReference,
                         .parameters = {{"incidence_shift_deg", 0, -20, 20, 2}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.plate.incidence_angle_rad += p[0] * std::numbers::pi / 180;
  }
};

}  // namespace

const Effect& CameraDistanceError() {
  static const CameraDistanceErrorEffect effect;
  return effect;
}
const Effect& LaserDistanceError() {
  static const LaserDistanceErrorEffect effect;
  return effect;
}
const Effect& IncidenceAngleError() {
  static const IncidenceAngleErrorEffect effect;
  return effect;
}

}  // namespace sightline
