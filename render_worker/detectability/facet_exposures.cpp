// SPDX-License-Identifier: Apache-2.0
#include "render_worker/detectability/facet_exposures.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/detectability/exposure_range.h"
#include "render_worker/optical_planning/choose_setting.h"
#include "render_worker/optical_planning/lens_image.h"
#include "render_worker/optical_planning/setting_judge.h"

namespace sightline {
namespace {

// Half edge of a facet that fills the region under every incidence of the grid, in camera
// distances.
constexpr double kFacetHalfEdge = 1.2;

// The inspection of a facet of one material.
Inspection FacetInspection(const Inspection& inspection, const v1::Material& material,
                           double laser_distance_m, double f_number) {
  Inspection facet = inspection;
  facet.materials = {{"", material}};
  facet.obstacles.clear();
  facet.lighting.clear_area_lights();
  facet.rig.laser.distance_m = laser_distance_m;
  facet.rig.lens->f_number = f_number;
  facet.rig.part_placement.reset();
  facet.rig.part_support_points_m.reset();
  // A plane does not light itself.
  facet.render.max_bounces = 0;
  facet.render.laser_interreflection = false;
  facet.optics->f_numbers = {f_number};
  facet.optics->exposure_time_s.reset();
  facet.optics->realisations = 2;
  facet.optics->two_exposures = false;
  return facet;
}

}  // namespace

absl::StatusOr<std::unique_ptr<PartScene>> MakeFacetScene(const Inspection& inspection,
                                                          const v1::Material& material,
                                                          double laser_distance_m,
                                                          double farthest_camera_m, double f_number,
                                                          const AssetResolver& assets) {
  PartSceneInput input;
  input.inspection = FacetInspection(inspection, material, laser_distance_m, f_number);
  input.part = FacetMesh(kFacetHalfEdge * farthest_camera_m);
  input.assets = assets;
  return PartScene::Make(std::move(input));
}

absl::StatusOr<ExposureRange> FacetExposures(PartScene& scene,
                                             std::span<const ActiveEffect> effects,
                                             const FacetView& view, double min_detected_fraction,
                                             uint64_t seed, const RenderLimits& limits) {
  const Inspection& inspection = scene.inspection();
  PartFrameRequest request;
  request.measurement = MeasurementOf(view);
  LensSetting lens;
  lens.f_number = inspection.rig.lens->f_number;
  lens.focus_distance_m =
      std::max({view.camera_distance_m, inspection.rig.lens->min_focus_distance_m.value_or(0),
                1.01 * inspection.rig.lens->focal_length_m});
  FrameSetup frame = PartFrameSetup(inspection, request);
  frame.lens.f_number = lens.f_number;
  frame.lens.focus_distance_m = lens.focus_distance_m;
  frame = ApplyFrameEffects(frame, effects);
  const std::array<double, 1> depths = {view.camera_distance_m};
  FrameLightOptions options;
  options.margin_px = LensMarginPx(frame, effects, depths);
  options.roi = RegionAboutLine(inspection.rig, request.measurement);
  options.limits = limits;
  auto light = TraceFrameLight(scene, request, effects, options);
  if (ErrorReason(light.status()) == "NO_LINE") return ExposureRange{};
  if (!light.ok()) return light.status();
  // Nothing comes from there to the camera.
  if (!(light->median_line_radiance_w_m2_sr > 0)) return ExposureRange{};
  SettingJudge judge(inspection, effects,
                     {{std::make_shared<const FrameLight>(*std::move(light)), 1}}, seed, limits);
  // The shortest of the grid fills a 25th of a bright pixel.
  const double fill_s = 25 * MakeExposureGrid(judge, inspection, ExposureLimit{}).min_s;
  SIGHTLINE_RETURN_IF_ERROR(judge.LookThrough(lens));
  return FindExposureRange(judge, inspection, fill_s, min_detected_fraction);
}

}  // namespace sightline
