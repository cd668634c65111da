// SPDX-License-Identifier: Apache-2.0
#include "render_worker/render/part_frame.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/random/counter_random.h"
#include "core/status/status_macros.h"
#include "render_worker/render/memory_estimate.h"
#include "render_worker/render/part_view.h"

namespace sightline {
namespace {

// Fewest samples per sub-pixel that still give an estimate of their error.
constexpr int kFewestSamples = 4;
// Moments of an exposure in motion: the image moves by at most this between two of them.
constexpr double kLightStep_px = 0.5;
constexpr int kMaxLightMoments = 17;
// Speckle decorrelates over about lambda b / D; moments are half of that apart.
constexpr double kSpeckleStep = 0.5;
constexpr int kMaxSpeckleMoments = 65;
// Light that diffraction brings in from farther outside the image than the margin: the wings of the
// Airy pattern fall off so slowly that a thousandth would take margins of hundreds of pixels.
constexpr double kLostEnergy = 0.01;
// Beyond this many radii of the Airy disc incoherent light is taken as lost.
constexpr double kIncoherentMarginAiry = 8;

uint64_t HashNumbers(const Measurement& measurement, double stage_position_m) {
  uint64_t hash = 0xcbf29ce484222325;  // FNV-1a
  const auto add = [&hash](double number) {
    auto bits = std::bit_cast<uint64_t>(number + 0.0);  // -0 is 0
    for (int byte = 0; byte < 8; ++byte, bits >>= 8) {
      hash = (hash ^ (bits & 0xff)) * 0x100000001b3;
    }
  };
  for (const double parameter : ToArray(measurement)) add(parameter);
  add(stage_position_m);
  return hash;
}

bool Cancelled(const RenderLimits& limits) {
  return limits.cancelled != nullptr && *limits.cancelled;
}

// Part of a frame's work as progress of the whole.
TransportProgress Share(const RenderLimits& limits, double begin, double end) {
  TransportProgress progress;
  progress.cancelled = limits.cancelled;
  if (limits.progress) {
    progress.report = [&limits, begin, end](double fraction) {
      limits.progress(begin + (end - begin) * fraction);
    };
  }
  return progress;
}

// Depths of the surfaces that the camera sees, by coarse rays; without any: the focused plane.
struct DepthRange {
  double nearest_m, farthest_m;
};
absl::StatusOr<DepthRange> VisibleDepths(const LightTransport& transport, const SceneView& view,
                                         const FrameSetup& frame, const TransportSettings& settings,
                                         const RenderLimits& limits) {
  const SubPixelGrid coarse = CoarseGrid(frame, /*step=*/8);
  TransportSettings direct = settings;
  direct.max_bounces = 0;
  direct.laser_interreflection = false;
  SIGHTLINE_ASSIGN_OR_RETURN(auto seen,
                             transport.TraceLaser(view, coarse, direct, Share(limits, 0, 0)));
  DepthRange range{view.focus_distance_m, view.focus_distance_m};
  bool any = false;
  for (const float depth : seen.depth_m.values) {
    if (depth <= 0) continue;
    range.nearest_m = any ? std::min<double>(range.nearest_m, depth) : depth;
    range.farthest_m = any ? std::max<double>(range.farthest_m, depth) : depth;
    any = true;
  }
  return range;
}

double LargestCurvature(const OpticsModel& optics, const FrameSetup& frame,
                        const DepthRange& depths) {
  const double pitch = frame.sensor.pixel_pitch_m;
  const double left = frame.roi.column_px * pitch, top = frame.roi.row_px * pitch;
  const double right = left + frame.roi.columns_px * pitch,
               bottom = top + frame.roi.rows_px * pitch;
  double largest = 0;
  for (const double depth : {depths.nearest_m, depths.farthest_m}) {
    for (const auto& [u, v] : {std::pair(0.0, 0.0), std::pair(left, top), std::pair(right, top),
                               std::pair(left, bottom), std::pair(right, bottom)}) {
      largest = std::max(largest, std::abs(optics.curvature(depth, u, v)));
    }
  }
  return largest;
}

SubPixelGrid IncoherentGrid(const FrameSetup& frame) {
  const double longest_m = frame.laser.wavelength_m;
  const double focal_ratio = frame.ImageDistance() / frame.PupilDiameter();
  const double pitch = frame.sensor.pixel_pitch_m;
  SubPixelGrid grid;
  grid.roi = frame.roi;
  grid.pixel_pitch_m = pitch;
  // Means over whole pixels: what an edge holds above their Nyquist frequency is damped as if it
  // were at its alias, which moves edge pixels by at most some per cent of the edge's contrast.
  // Half pixels would mend that at four times the cost.
  grid.sub_pixels = 1;
  grid.margin_px = std::clamp(
      static_cast<int>(std::ceil(kIncoherentMarginAiry * 1.22 * longest_m * focal_ratio / pitch)),
      4, 64);
  return grid;
}

// Mean over the sub-pixels of every pixel of the region; `skip` is left out (0 if all are).
Image<float> PixelMeans(const Image<float>& samples, const SubPixelGrid& grid, bool skip_zero) {
  Image<float> means(grid.roi.columns_px, grid.roi.rows_px);
  const int s = grid.sub_pixels, margin = grid.margin_px * s;
  for (int row = 0; row < means.rows_px; ++row) {
    for (int column = 0; column < means.columns_px; ++column) {
      double sum = 0;
      int count = 0;
      for (int i = 0; i < s; ++i) {
        for (int j = 0; j < s; ++j) {
          const float value = samples.At(margin + row * s + i, margin + column * s + j);
          if (skip_zero && value == 0) continue;
          sum += value;
          ++count;
        }
      }
      means.At(row, column) = count > 0 ? static_cast<float>(sum / count) : 0.F;
    }
  }
  return means;
}

// The material in the middle of every pixel.
Image<float> PixelMaterials(const Image<uint16_t>& samples, const SubPixelGrid& grid) {
  Image<float> materials(grid.roi.columns_px, grid.roi.rows_px);
  const int s = grid.sub_pixels, first = grid.margin_px * s + s / 2;
  for (int row = 0; row < materials.rows_px; ++row) {
    for (int column = 0; column < materials.columns_px; ++column) {
      const uint16_t material = samples.At(first + row * s, first + column * s);
      materials.At(row, column) = material == 0xffff ? -1.F : static_cast<float>(material);
    }
  }
  return materials;
}

// Noise targets and samples are per pixel and exposure; a pixel is the mean of its sub-pixels, an
// exposure that of its moments.
void ShareTargets(int sub_pixels, int moments, TransportSettings* settings) {
  const double shares = static_cast<double>(sub_pixels) * sub_pixels * moments;
  settings->noise_target_relative *= std::sqrt(shares);
  settings->laser_noise_target_relative *= std::sqrt(shares);
  const auto share = [shares](int samples) {
    return std::max<int>(kFewestSamples, std::bit_floor(static_cast<unsigned>(samples / shares)));
  };
  settings->first_samples_per_px = share(settings->first_samples_per_px);
  settings->max_samples_per_px = share(settings->max_samples_per_px);
  settings->laser_max_samples_per_px = share(settings->laser_max_samples_per_px);
}

// `count` moments evenly over [-1/2, 1/2] of the exposure, each the middle of its share.
std::vector<double> Moments(int count) {
  std::vector<double> moments;
  for (int i = 0; i < count; ++i) moments.push_back((i + 0.5) / count - 0.5);
  return moments;
}

}  // namespace

FrameSetup PartFrameSetup(const Inspection& inspection, const PartFrameRequest& request) {
  assert(inspection.sensor && inspection.rig.lens);
  const RenderSettings& settings = inspection.render;
  FrameSetup frame;
  frame.sensor = *inspection.sensor;
  frame.lens = *inspection.rig.lens;
  if (!frame.lens.focus_distance_m) {
    frame.lens.focus_distance_m = request.measurement.camera_distance_m;
  }
  frame.laser = inspection.rig.laser;
  frame.exposure_time_s = settings.exposure_time_s;
  if (request.setting) {
    frame.lens.f_number = request.setting->f_number;
    frame.lens.focus_distance_m = request.setting->focus_distance_m;
    frame.lens.sensor_tilt_x_rad = request.setting->sensor_tilt_x_rad;
    frame.lens.sensor_tilt_y_rad = request.setting->sensor_tilt_y_rad;
    frame.laser.power_w = request.setting->laser_power_w;
    frame.exposure_time_s = request.setting->exposure_time_s;
  }
  frame.plate.camera_distance_m = request.measurement.camera_distance_m;
  frame.plate.laser_distance_m =
      inspection.rig.laser.distance_m.value_or(request.measurement.camera_distance_m);
  frame.plate.incidence_angle_rad = std::abs(request.measurement.triangulation_angle_rad);
  const int columns = inspection.rig.camera.columns_px, rows = inspection.rig.camera.rows_px;
  frame.roi = {-(columns / 2), -(rows / 2), columns, rows};
  const auto seed = static_cast<uint64_t>(settings.seed);
  const uint64_t place = HashNumbers(request.measurement, request.stage_position_m);
  frame.seeds.speckle = DeriveSeed(seed, "speckle", place);
  frame.seeds.noise = DeriveSeed(seed, "noise", place);
  frame.seeds.camera = DeriveSeed(seed, "camera");
  frame.seeds.rig = DeriveSeed(seed, "rig");
  frame.sensor_temperature_c =
      settings.sensor_temperature_c.value_or(frame.sensor.dark_current_reference_temperature_c);
  frame.speckle_pattern_weights.assign(static_cast<size_t>(settings.speckle_patterns),
                                       1.0 / settings.speckle_patterns);
  frame.speckle = settings.speckle;
  frame.sub_pixels = settings.sub_pixels;
  return frame;
}

absl::StatusOr<RenderedPartFrame> RenderPartFrame(PartScene& scene, const PartFrameRequest& request,
                                                  std::span<const ActiveEffect> effects,
                                                  bool layers, const RenderLimits& limits) {
  const Inspection& inspection = scene.inspection();
  const FrameSetup nominal = PartFrameSetup(inspection, request);
  SIGHTLINE_RETURN_IF_ERROR(CheckEffectsActOnParts(nominal, effects));
  const FrameSetup frame = ApplyFrameEffects(nominal, effects);
  const TrueGeometry truth =
      WithGeometryErrors(inspection.rig, request.measurement, nominal, frame);
  const OpticsModel optics = MakeOpticsModel(frame, effects);
  RenderedPartFrame result;
  result.warnings = ScaleWarnings(scene, frame);

  const TransportSettings settings = TransportSettingsOf(inspection.render, frame, limits.threads);

  const double travel_m = inspection.render.stage_speed_m_per_s * frame.exposure_time_s;
  const Eigen::Vector2d motion_m = ImageMotion(truth, frame, travel_m);
  const int light_moments = std::clamp(
      static_cast<int>(std::ceil(motion_m.norm() / (kLightStep_px * frame.sensor.pixel_pitch_m))),
      1, kMaxLightMoments);
  const double speckle_size_m =
      frame.laser.wavelength_m * frame.ImageDistance() / frame.PupilDiameter();
  const int speckle_moments =
      std::clamp(static_cast<int>(std::ceil(motion_m.norm() / (kSpeckleStep * speckle_size_m))), 1,
                 kMaxSpeckleMoments);

  SIGHTLINE_ASSIGN_OR_RETURN(auto middle,
                             scene.TransportAt(truth.measurement, request.stage_position_m));
  const SceneView middle_view = MakeView(scene, truth, frame, request.stage_position_m);
  SIGHTLINE_ASSIGN_OR_RETURN(auto depths,
                             VisibleDepths(*middle, middle_view, frame, settings, limits));
  const SubPixelGrid grid =
      MakeSubPixelGrid(frame, optics, LargestCurvature(optics, frame, depths), kLostEnergy);
  const SubPixelGrid incoherent_grid = IncoherentGrid(frame);
  const int channels = scene.has_incoherent_light() ? frame.sensor.channels() : 0;
  SIGHTLINE_RETURN_IF_ERROR(CheckFrameBytes(FrameBytes(grid, incoherent_grid, channels),
                                            limits.max_image_bytes, frame, grid.sub_pixels,
                                            "image"));

  // Light transport; the exposure is the mean of its moments.
  IdealImage ideal;
  ideal.grid = grid;
  ideal.constant_depth_m = *frame.lens.focus_distance_m;
  ideal.incoherent_grid = incoherent_grid;
  std::vector<Spectrum> weights;
  for (int channel = 0; channel < channels; ++channel) {
    weights.push_back(ElectronsPerJoule(frame.sensor.quantum_efficiency[channel]));
    ideal.incoherent_wavelength_m[channel] = MeanWavelength(scene.LightSpectrum(), weights.back(),
                                                            ideal.incoherent_wavelength_m[channel]);
  }
  TransportSettings incoherent_settings = settings;
  ShareTargets(incoherent_grid.sub_pixels, light_moments, &incoherent_settings);
  TransportSettings laser_settings = settings;
  ShareTargets(1, light_moments, &laser_settings);  // laser light is sampled by the pixel
  // Depth and material are of use even where the laser is off.
  if (!frame.laser_on) laser_settings.laser_interreflection = false;
  Image<float> incoherent_radiance;
  FrameLayers pixel_layers;
  const std::vector<double> moments = Moments(light_moments);
  const auto moment_weight = static_cast<float>(1.0 / light_moments);
  const double laser_share = channels > 0 ? 0.3 : 0.7, light_share = channels > 0 ? 0.4 : 0.0;
  for (int m = 0; m < light_moments; ++m) {
    const double stage_m = request.stage_position_m + moments[m] * travel_m;
    SIGHTLINE_ASSIGN_OR_RETURN(auto transport, scene.TransportAt(truth.measurement, stage_m));
    const SceneView view = MakeView(scene, truth, frame, stage_m);
    const double begin = (laser_share + light_share) * m / light_moments;
    const double after_laser = begin + laser_share / light_moments;
    const double end = after_laser + light_share / light_moments;
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto laser,
        transport->TraceLaser(view, grid, laser_settings, Share(limits, begin, after_laser)));
    if (m == light_moments / 2) {
      if (layers) {
        pixel_layers.depth_m = PixelMeans(laser.depth_m, grid, /*skip_zero=*/true);
        pixel_layers.material = PixelMaterials(laser.material, grid);
      }
      ideal.depth_m = std::move(laser.depth_m);
      for (float& depth : ideal.depth_m.values) {
        if (depth <= 0) depth = static_cast<float>(ideal.constant_depth_m);
      }
    }
    laser.material = {};
    laser.indirect_radiance_w_m2_sr = {};
    if (ideal.laser_irradiance_w_m2.empty()) {
      ideal.laser_irradiance_w_m2 = std::move(laser.radiance_w_m2_sr);
      for (float& radiance : ideal.laser_irradiance_w_m2.values) radiance *= moment_weight;
    } else {
      for (size_t i = 0; i < ideal.laser_irradiance_w_m2.values.size(); ++i) {
        ideal.laser_irradiance_w_m2.values[i] += moment_weight * laser.radiance_w_m2_sr.values[i];
      }
    }
    if (channels == 0) continue;
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto other, transport->TraceIncoherent(view, incoherent_grid, weights, incoherent_settings,
                                               Share(limits, after_laser, end)));
    if (m == 0) {
      incoherent_radiance = Image<float>(incoherent_grid.columns(), incoherent_grid.rows());
      for (int channel = 0; channel < channels; ++channel) {
        ideal.incoherent_electron_flux_m2_s[channel] = incoherent_radiance;
      }
    }
    const auto add = [moment_weight](const Image<float>& from, Image<float>* to) {
      for (size_t i = 0; i < to->values.size(); ++i)
        to->values[i] += moment_weight * from.values[i];
    };
    add(other.radiance_w_m2_sr, &incoherent_radiance);
    for (int channel = 0; channel < channels; ++channel) {
      add(other.channel_radiance[channel], &ideal.incoherent_electron_flux_m2_s[channel]);
    }
    // Another seed for every moment: their noise averages out.
    incoherent_settings.seed = DeriveSeed(settings.seed, "moment", static_cast<uint64_t>(m) + 1);
  }
  if (layers) {
    pixel_layers.laser_radiance_w_m2_sr = PixelMeans(ideal.laser_irradiance_w_m2, grid, false);
    if (channels > 0) {
      pixel_layers.incoherent_radiance_w_m2_sr =
          PixelMeans(incoherent_radiance, incoherent_grid, false);
    }
  }

  // Radiance to irradiance.
  const IrradianceFactor factor(frame, middle_view.image_distance_m);
  const auto scale = [&factor](const SubPixelGrid& of, Image<float>* image) {
    for (int i = 0; i < image->rows_px; ++i) {
      float* row = image->Row(i);
      for (int j = 0; j < image->columns_px; ++j) {
        row[j] *= static_cast<float>(factor(of.U(j), of.V(i)));
      }
    }
  };
  if (!frame.laser_on || !frame.shutter_open) {
    std::fill(ideal.laser_irradiance_w_m2.values.begin(), ideal.laser_irradiance_w_m2.values.end(),
              0.F);
  }
  scale(grid, &ideal.laser_irradiance_w_m2);
  if (channels > 0) {
    ideal.incoherent_irradiance_w_m2 = std::move(incoherent_radiance);
    scale(incoherent_grid, &ideal.incoherent_irradiance_w_m2);
    for (int channel = 0; channel < channels; ++channel) {
      scale(incoherent_grid, &ideal.incoherent_electron_flux_m2_s[channel]);
    }
  }
  if (Cancelled(limits)) return absl::CancelledError("cancelled");

  SpeckleModel speckle;
  speckle.seed = frame.seeds.speckle;
  speckle.pattern_weights = frame.speckle_pattern_weights;
  speckle.on = frame.speckle;
  speckle.shifts.clear();
  for (const double moment : Moments(speckle_moments)) {
    speckle.shifts.push_back({moment * motion_m.x(), moment * motion_m.y()});
  }
  if (limits.progress) limits.progress(laser_share + light_share);
  SIGHTLINE_ASSIGN_OR_RETURN(result.image,
                             FormImage(std::move(ideal), frame, effects, speckle,
                                       /*previous_mean_electrons=*/nullptr, limits.threads));
  if (layers) {
    pixel_layers.laser_irradiance_w_m2 = result.image.light.laser_irradiance_w_m2;
    Image<float> electrons(frame.roi.columns_px, frame.roi.rows_px);
    std::transform(result.image.mean_photo_electrons.values.begin(),
                   result.image.mean_photo_electrons.values.end(), electrons.values.begin(),
                   [](double value) { return static_cast<float>(value); });
    pixel_layers.photo_electrons = std::move(electrons);
    result.layers = std::move(pixel_layers);
  }
  if (Cancelled(limits)) return absl::CancelledError("cancelled");
  if (limits.progress) limits.progress(1);
  return result;
}

}  // namespace sightline
