// SPDX-License-Identifier: Apache-2.0
#include "render_worker/render/part_view.h"

#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/random/counter_random.h"
#include "render_worker/plate/plate_scene.h"

namespace sightline {

absl::Status CheckEffectsActOnParts(const FrameSetup& nominal,
                                    std::span<const ActiveEffect> effects) {
  for (const ActiveEffect& active : effects) {
    const std::string id(active.effect->description().id);
    FrameSetup changed = nominal;
    active.effect->OnFrame(changed, active.parameters);
    const bool surface = changed.surface.diffuse_albedo != nominal.surface.diffuse_albedo ||
                         changed.surface.specular_f0 != nominal.surface.specular_f0 ||
                         changed.surface.ggx_alpha != nominal.surface.ggx_alpha;
    if (surface || changed.plate.line_offset_m != nominal.plate.line_offset_m) {
      return absl::InvalidArgumentError(absl::StrCat(
          "effects: ", id, " acts on a flat plate only; for a part change its materials"));
    }
    const PlateScene before = MakePlateScene(nominal);
    PlateScene after = before;
    active.effect->OnPlate(after, nominal, active.parameters);
    const auto differs = [](const PlateFunction& a, const PlateFunction& b) {
      if (static_cast<bool>(a) != static_cast<bool>(b)) return true;
      if (!a) return false;
      for (const auto& [x, s] : {std::pair(0.0, 0.0), std::pair(1.7e-3, 0.0),
                                 std::pair(0.0, 0.31e-3), std::pair(-9.3e-3, -4.1e-3)}) {
        if (a(x, s) != b(x, s)) return true;
      }
      return false;
    };
    if (differs(before.laser_irradiance_w_m2, after.laser_irradiance_w_m2) ||
        differs(before.brdf_per_sr, after.brdf_per_sr) ||
        differs(before.height_m, after.height_m) ||
        differs(before.ambient_radiance_w_m2_sr, after.ambient_radiance_w_m2_sr)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "effects: ", id,
          " acts on a flat plate only; for a part use its materials, lighting and laser"));
    }
    // Parts are seen through lens.distortion.
    if (after.image_mapping && changed.lens.distortion == nominal.lens.distortion) {
      return absl::InvalidArgumentError(
          absl::StrCat("effects: ", id, " acts on a flat plate only; images of parts do not turn"));
    }
  }
  return absl::OkStatus();
}

TrueGeometry WithGeometryErrors(const Rig& rig, const Measurement& measurement,
                                const FrameSetup& nominal, const FrameSetup& frame) {
  TrueGeometry truth{rig, measurement};
  truth.measurement.camera_distance_m +=
      frame.plate.camera_distance_m - nominal.plate.camera_distance_m;
  truth.measurement.triangulation_angle_rad +=
      std::copysign(frame.plate.incidence_angle_rad - nominal.plate.incidence_angle_rad,
                    measurement.triangulation_angle_rad);
  truth.rig.laser.distance_m = frame.plate.laser_distance_m;
  return truth;
}

SceneView MakeView(const PartScene& scene, const TrueGeometry& truth, const FrameSetup& frame,
                   double stage_position_m) {
  const ScanGeometry geometry = MakeScanGeometry(truth.rig, truth.measurement);
  SceneView view;
  view.camera = WorldToPart(geometry, scene.part_centre_m(), geometry.camera, stage_position_m);
  view.laser = WorldToPart(geometry, scene.part_centre_m(), geometry.laser, stage_position_m);
  // Planning's pinhole: the calibrated principal distance.
  view.image_distance_m = truth.rig.camera.FocalLengthPx() * frame.sensor.pixel_pitch_m;
  view.focus_distance_m = *frame.lens.focus_distance_m;
  view.pupil_radius_m = 0.5 * frame.PupilDiameter();
  view.sensor_slope_u = std::tan(frame.lens.sensor_tilt_y_rad);
  view.sensor_slope_v = std::tan(frame.lens.sensor_tilt_x_rad);
  view.distortion = frame.lens.distortion;
  view.laser_source = frame.laser;
  return view;
}

TransportSettings TransportSettingsOf(const RenderSettings& render, const FrameSetup& frame,
                                      int threads) {
  TransportSettings settings;
  settings.max_bounces = render.max_bounces;
  settings.laser_interreflection = render.laser_interreflection;
  settings.noise_target_relative = render.noise_target_relative;
  settings.max_samples_per_px = render.max_samples_per_px;
  settings.seed =
      DeriveSeed(static_cast<uint64_t>(render.seed), "light transport", frame.seeds.noise);
  settings.threads = threads;
  return settings;
}

SubPixelGrid CoarseGrid(const FrameSetup& frame, int step) {
  SubPixelGrid coarse;
  coarse.pixel_pitch_m = step * frame.sensor.pixel_pitch_m;
  coarse.sub_pixels = 1;
  coarse.roi = {static_cast<int>(std::floor(static_cast<double>(frame.roi.column_px) / step)),
                static_cast<int>(std::floor(static_cast<double>(frame.roi.row_px) / step)),
                frame.roi.columns_px / step + 1, frame.roi.rows_px / step + 1};
  return coarse;
}

Eigen::Vector2d ImageMotion(const TrueGeometry& truth, const FrameSetup& frame, double travel_m) {
  const ScanGeometry geometry = MakeScanGeometry(truth.rig, truth.measurement);
  const double magnification = frame.ImageDistance() / truth.measurement.camera_distance_m;
  return magnification * travel_m *
         Eigen::Vector2d(geometry.camera.x_axis.x(), geometry.camera.y_axis.x());
}

IrradianceFactor::IrradianceFactor(const FrameSetup& frame, double chief_distance_m)
    : on_axis_(std::numbers::pi / 4 * frame.lens.transmission *
               std::pow(frame.PupilDiameter() / frame.ImageDistance(), 2)),
      b2_(chief_distance_m * chief_distance_m) {}

double IrradianceFactor::operator()(double u_m, double v_m) const {
  const double cos2 = b2_ / (b2_ + u_m * u_m + v_m * v_m);
  return on_axis_ * cos2 * cos2;
}

double MeanWavelength(const Spectrum& light, const Spectrum& weight, double fallback_m) {
  double sum = 0, moment = 0;
  for (int bin = 0; bin < kSpectralBins; ++bin) {
    const double share = static_cast<double>(light[bin]) * weight[bin];
    sum += share;
    moment += share * BinCentre_m(bin);
  }
  return sum > 0 ? moment / sum : fallback_m;
}

std::vector<std::string> ScaleWarnings(const PartScene& scene, const FrameSetup& frame) {
  std::vector<std::string> warnings;
  const double footprint_m =
      frame.sensor.pixel_pitch_m * frame.plate.camera_distance_m / frame.ImageDistance();
  for (size_t i = 0; i < scene.materials().size(); ++i) {
    const std::optional<std::string> warning =
        CheckScale(*scene.materials()[i],
                   scene.material_names()[i].empty() ? absl::StrCat("materials[", i, "]")
                                                     : scene.material_names()[i],
                   footprint_m);
    if (warning) warnings.push_back(*warning);
  }
  return warnings;
}

}  // namespace sightline
