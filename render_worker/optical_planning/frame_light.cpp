// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/frame_light.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/light_transport/camera_rays.h"
#include "render_worker/plate/line_width.h"
#include "render_worker/render/memory_estimate.h"
#include "render_worker/render/part_view.h"

namespace sightline {
namespace {

// Samples per standard deviation of the line's profile, so that interpolation between them keeps
// it.
constexpr double kSamplesPerDeviation = 2.2;
constexpr int kFewestSubPixels = 2, kMostSubPixels = 8;
// Other light blurs by little; what comes in from farther is a part in a hundred of it at the rim.
constexpr int kMostIncoherentMargin_px = 16;
// Standard error of other light at a pixel, relative to itself. It is the background of the line,
// darker than it; a tenth of it is less than the photon noise of a line that can be detected.
constexpr double kIncoherentNoise = 0.1;
constexpr int kFirstIncoherentSamples = 4;
// Across an edge the depth jumps: a step across the sheet this many times that of the neighbours is
// no surface.
constexpr double kLargestStep = 6;

// Rows of the grid in which a column of sub-pixels crosses the middle of the sheet.
std::vector<double> CrossingRows(const CameraRays& camera, const SceneView& view,
                                 const SubPixelGrid& grid, const LaserTransport& laser,
                                 int column) {
  struct Sample {
    bool lit = false;
    double q_m = 0;
    double depth_m = 0;
  };
  const auto sample = [&](int row) {
    const float depth = laser.depth_m.At(row, column);
    const float direct =
        laser.radiance_w_m2_sr.At(row, column) - laser.indirect_radiance_w_m2_sr.At(row, column);
    if (depth <= 0 || !(direct > 0)) return Sample{};
    const Eigen::Vector3d point =
        camera.origin_m() + double{depth} * camera.ChiefDirection(grid.U(column), grid.V(row));
    return Sample{true, (point - view.laser.origin_m).dot(view.laser.y_axis), depth};
  };
  std::vector<double> rows;
  Sample before = sample(0);
  for (int row = 1; row < grid.rows(); ++row) {
    const Sample here = sample(row);
    if (before.lit && here.lit && (before.q_m < 0) != (here.q_m < 0)) {
      // The part of a step that is due to the slope of the surface: of its neighbours.
      const double step = std::abs(here.q_m - before.q_m);
      double neighbour = 0;
      if (row >= 2) {
        const Sample farther = sample(row - 2);
        if (farther.lit) neighbour = std::max(neighbour, std::abs(before.q_m - farther.q_m));
      }
      if (row + 1 < grid.rows()) {
        const Sample farther = sample(row + 1);
        if (farther.lit) neighbour = std::max(neighbour, std::abs(farther.q_m - here.q_m));
      }
      if (neighbour > 0 && step <= kLargestStep * neighbour) {
        rows.push_back(row - 1 + before.q_m / (before.q_m - here.q_m));
      }
    }
    before = here;
  }
  return rows;
}

// Depths where a ray met nothing become those of the nearest sample in the row that met something:
// what diffraction brings from there is dark anyway.
void FillDepths(double fallback_m, Image<float>* depth_m) {
  for (int row = 0; row < depth_m->rows_px; ++row) {
    float* values = depth_m->Row(row);
    float last = 0;
    for (int column = 0; column < depth_m->columns_px; ++column) {
      if (values[column] > 0) {
        last = values[column];
      } else if (last > 0) {
        values[column] = last;
      }
    }
    for (int column = depth_m->columns_px - 1; column >= 0; --column) {
      if (values[column] > 0) {
        last = values[column];
      } else {
        values[column] = last > 0 ? last : static_cast<float>(fallback_m);
      }
    }
  }
}

// The value that this share of them is below; 0 of none.
double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto place = static_cast<size_t>(share * static_cast<double>(values.size()));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::min(place, values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Mean over a pixel's worth of samples about one of them.
double PixelMean(const Image<float>& samples, int row, int column, int sub_pixels) {
  double sum = 0;
  for (int i = 0; i < sub_pixels; ++i) {
    for (int j = 0; j < sub_pixels; ++j) {
      sum += samples.At(std::clamp(row - sub_pixels / 2 + i, 0, samples.rows_px - 1),
                        std::clamp(column - sub_pixels / 2 + j, 0, samples.columns_px - 1));
    }
  }
  return sum / (sub_pixels * sub_pixels);
}

// The camera's view of the surface at a sub-pixel, from the depths about it.
// Of the neighbours to either side the one at the more similar depth lies on the same surface.
LineView ViewAt(const CameraRays& camera, const SubPixelGrid& grid, const Image<float>& depth_m,
                int row, int column) {
  const auto point = [&](int i, int j) -> Eigen::Vector3d {
    const Eigen::Vector3d ray = camera.ChiefDirection(grid.U(j), grid.V(i));
    return double{depth_m.At(i, j)} * ray;
  };
  const Eigen::Vector3d here = point(row, column);
  const auto along = [&](int rows, int columns) -> Eigen::Vector3d {
    Eigen::Vector3d best = Eigen::Vector3d::Zero();
    double least = std::numeric_limits<double>::infinity();
    for (const int side : {-1, 1}) {
      const int i = row + side * rows, j = column + side * columns;
      if (i < 0 || i >= depth_m.rows_px || j < 0 || j >= depth_m.columns_px) continue;
      if (!(depth_m.At(i, j) > 0)) continue;
      const double step = std::abs(depth_m.At(i, j) - depth_m.At(row, column));
      if (step < least) {
        least = step;
        best = side * (point(i, j) - here);
      }
    }
    return best;
  };
  // Over a pixel: depths are single precision.
  const Eigen::Vector3d normal = along(grid.sub_pixels, 0).cross(along(0, grid.sub_pixels));
  LineView view;
  view.distance_m = here.norm();
  const double lengths = normal.norm() * here.norm();
  view.incidence_rad =
      lengths > 0 ? std::acos(std::min(1.0, std::abs(normal.dot(here)) / lengths)) : 0;
  return view;
}

// A frame as a pinhole in the pupil's centre sees it.
struct PinholeFrame {
  FrameSetup frame;
  SceneView view;
  std::shared_ptr<const LightTransport> transport;
};
absl::StatusOr<PinholeFrame> MakePinholeFrame(PartScene& scene, const PartFrameRequest& request,
                                              std::span<const ActiveEffect> effects,
                                              const std::optional<RegionOfInterest>& roi) {
  FrameSetup nominal = PartFrameSetup(scene.inspection(), request);
  if (roi) nominal.roi = *roi;
  PinholeFrame pinhole;
  pinhole.frame = ApplyFrameEffects(nominal, effects);
  const TrueGeometry truth =
      WithGeometryErrors(scene.inspection().rig, request.measurement, nominal, pinhole.frame);
  pinhole.view = MakeView(scene, truth, pinhole.frame, request.stage_position_m);
  pinhole.view.pupil_radius_m = 0;
  SIGHTLINE_ASSIGN_OR_RETURN(pinhole.transport,
                             scene.TransportAt(truth.measurement, request.stage_position_m));
  return pinhole;
}

// Row of the grid at a pixel's row.
double GridRow(const SubPixelGrid& grid, double row_px) {
  return (row_px + grid.margin_px + 0.5) * grid.sub_pixels - 0.5;
}

}  // namespace

std::vector<LineCrossing> FindTrueLine(const SceneView& view, const SubPixelGrid& grid,
                                       const LaserTransport& laser) {
  const CameraRays camera(view);
  std::vector<LineCrossing> line;
  const int s = grid.sub_pixels;
  for (int column = 0; column < grid.roi.columns_px; ++column) {
    // The pixel's centre lies on a column of sub-pixels, or between two.
    const int right = (column + grid.margin_px) * s + s / 2;
    std::vector<double> rows = CrossingRows(camera, view, grid, laser, right);
    if (s % 2 == 0) {
      const std::vector<double> left = CrossingRows(camera, view, grid, laser, right - 1);
      std::vector<double> between;
      for (const double row : rows) {
        // The same crossing half a sub-pixel to the left and to the right. At an edge, where one is
        // missing, the other replaces it.
        const auto nearest = std::min_element(left.begin(), left.end(), [row](double a, double b) {
          return std::abs(a - row) < std::abs(b - row);
        });
        const bool same = nearest != left.end() && std::abs(*nearest - row) < s;
        between.push_back(same ? (row + *nearest) / 2 : row);
      }
      rows = std::move(between);
    }
    for (const double row : rows) {
      const double row_px = (row + 0.5) / s - grid.margin_px - 0.5;
      if (row_px >= 0 && row_px <= grid.roi.rows_px - 1) line.push_back({column, row_px});
    }
  }
  return line;
}

absl::StatusOr<FrameLight> TraceFrameLight(PartScene& scene, const PartFrameRequest& request,
                                           std::span<const ActiveEffect> effects,
                                           const FrameLightOptions& options) {
  const Inspection& inspection = scene.inspection();
  SIGHTLINE_ASSIGN_OR_RETURN(auto pinhole, MakePinholeFrame(scene, request, effects, options.roi));
  const FrameSetup& frame = pinhole.frame;
  const SceneView& view = pinhole.view;

  FrameLight light;
  light.request = request;
  light.laser_power_w = frame.laser.power_w;
  light.chief_distance_m = view.image_distance_m;
  const Eigen::Vector3d& n = view.laser.y_axis;
  light.sheet_normal = {n.dot(view.camera.x_axis), n.dot(view.camera.y_axis),
                        n.dot(view.camera.z_axis)};
  light.sheet_offset_m = n.dot(view.laser.origin_m - view.camera.origin_m);
  // The line's own width, without the lens's part in it.
  FrameSetup sharp = frame;
  sharp.lens.f_number = 0.5;
  sharp.lens.focus_distance_m = sharp.plate.camera_distance_m;
  light.grid.roi = frame.roi;
  light.grid.pixel_pitch_m = frame.sensor.pixel_pitch_m;
  light.grid.margin_px = options.margin_px;
  light.grid.sub_pixels =
      std::clamp(static_cast<int>(std::ceil(kSamplesPerDeviation / NominalWidthPx(sharp))),
                 kFewestSubPixels, kMostSubPixels);

  light.incoherent_grid.roi = frame.roi;
  light.incoherent_grid.pixel_pitch_m = frame.sensor.pixel_pitch_m;
  light.incoherent_grid.sub_pixels = 1;
  light.incoherent_grid.margin_px = std::min(options.margin_px, kMostIncoherentMargin_px);
  const int channels = scene.has_incoherent_light() ? frame.sensor.channels() : 0;
  SIGHTLINE_RETURN_IF_ERROR(CheckFrameBytes(FrameBytes(light.grid, light.incoherent_grid, channels),
                                            options.limits.max_image_bytes, frame,
                                            light.grid.sub_pixels, "image"));

  TransportSettings settings =
      TransportSettingsOf(inspection.render, frame, options.limits.threads);
  // Other light, where there is some, takes about as long as that of the laser.
  const double laser_share = scene.has_incoherent_light() ? 0.5 : 1;
  TransportProgress progress;
  progress.cancelled = options.limits.cancelled;
  if (options.limits.progress) {
    progress.report = [&](double fraction) { options.limits.progress(laser_share * fraction); };
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto laser,
                             pinhole.transport->TraceLaser(view, light.grid, settings, progress));
  light.line = FindTrueLine(view, light.grid, laser);
  if (light.line.empty()) {
    return WithErrorInfo(absl::FailedPreconditionError(absl::StrCat(
                             "the laser lights nothing that the camera sees with the stage at ",
                             request.stage_position_m, " m")),
                         "NO_LINE");
  }
  const CameraRays rays(view);
  std::vector<double> depths, radiances;
  for (const LineCrossing& crossing : light.line) {
    const int column = (crossing.column_px + light.grid.margin_px) * light.grid.sub_pixels +
                       light.grid.sub_pixels / 2;
    const int row = std::clamp(static_cast<int>(std::lround(GridRow(light.grid, crossing.row_px))),
                               0, light.grid.rows() - 1);
    depths.push_back(laser.depth_m.At(row, column));
    light.line_views.push_back(ViewAt(rays, light.grid, laser.depth_m, row, column));
    radiances.push_back(PixelMean(laser.radiance_w_m2_sr, row, column, light.grid.sub_pixels));
  }
  light.median_line_depth_m = Quantile(depths, 0.5);
  light.median_line_radiance_w_m2_sr = Quantile(radiances, 0.5);
  light.dim_line_radiance_w_m2_sr = Quantile(radiances, 0.1);
  light.bright_line_radiance_w_m2_sr = Quantile(radiances, 0.9);
  light.laser_radiance_w_m2_sr = std::move(laser.radiance_w_m2_sr);
  light.depth_m = std::move(laser.depth_m);
  FillDepths(light.median_line_depth_m, &light.depth_m);

  if (!scene.has_incoherent_light()) return light;
  std::vector<Spectrum> weights;
  for (int channel = 0; channel < frame.sensor.channels(); ++channel) {
    weights.push_back(ElectronsPerJoule(frame.sensor.quantum_efficiency[channel]));
    light.incoherent_wavelength_m[channel] = MeanWavelength(scene.LightSpectrum(), weights.back(),
                                                            light.incoherent_wavelength_m[channel]);
  }
  settings.noise_target_relative = std::max(settings.noise_target_relative, kIncoherentNoise);
  settings.first_samples_per_px = kFirstIncoherentSamples;
  if (options.limits.progress) {
    progress.report = [&](double fraction) {
      options.limits.progress(laser_share + (1 - laser_share) * fraction);
    };
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto other,
      pinhole.transport->TraceIncoherent(view, light.incoherent_grid, weights, settings, progress));
  light.channel_radiance = std::move(other.channel_radiance);
  return light;
}

absl::StatusOr<FrameGlance> GlanceAtFrame(PartScene& scene, const PartFrameRequest& request,
                                          std::span<const ActiveEffect> effects, int margin_px,
                                          const RenderLimits& limits) {
  constexpr int kStep = 8;
  SIGHTLINE_ASSIGN_OR_RETURN(auto pinhole, MakePinholeFrame(scene, request, effects, std::nullopt));
  const FrameSetup& frame = pinhole.frame;
  const SubPixelGrid coarse = CoarseGrid(frame, kStep);
  TransportSettings settings;
  settings.max_bounces = 0;
  settings.laser_interreflection = false;
  settings.threads = limits.threads;
  TransportProgress progress;
  progress.cancelled = limits.cancelled;
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto laser, pinhole.transport->TraceLaser(pinhole.view, coarse, settings, progress));
  float brightest = 0;
  for (const float radiance : laser.radiance_w_m2_sr.values) {
    brightest = std::max(brightest, radiance);
  }
  FrameGlance glance;
  glance.roi = frame.roi;
  if (!(brightest > 0)) return glance;
  std::vector<double> logs, depths;
  int first_row = coarse.rows(), last_row = -1;
  for (int row = 0; row < coarse.rows(); ++row) {
    for (int column = 0; column < coarse.columns(); ++column) {
      const float radiance = laser.radiance_w_m2_sr.At(row, column);
      // Flanks of the beam are not the line.
      if (!(radiance > 1e-4F * brightest)) continue;
      logs.push_back(std::log(double{radiance}));
      depths.push_back(laser.depth_m.At(row, column));
      first_row = std::min(first_row, row);
      last_row = std::max(last_row, row);
    }
  }
  const auto moments = [](const std::vector<double>& values, double* mean, double* deviation) {
    double sum = 0, squares = 0;
    for (const double value : values) sum += value;
    *mean = sum / static_cast<double>(values.size());
    for (const double value : values) squares += (value - *mean) * (value - *mean);
    *deviation = std::sqrt(squares / static_cast<double>(values.size()));
  };
  glance.lit_samples = static_cast<int>(logs.size());
  moments(logs, &glance.mean_log_radiance, &glance.deviation_log_radiance);
  moments(depths, &glance.mean_depth_m, &glance.deviation_depth_m);
  const auto [nearest, farthest] = std::minmax_element(depths.begin(), depths.end());
  glance.nearest_m = *nearest;
  glance.farthest_m = *farthest;
  // Even rows, so that a Bayer cell stays whole.
  const auto even = [](int value) { return value - (value % 2 + 2) % 2; };
  const int top =
      std::max(frame.roi.row_px, even((coarse.roi.row_px + first_row - 1) * kStep - margin_px));
  const int bottom = std::min(frame.roi.row_px + frame.roi.rows_px,
                              even((coarse.roi.row_px + last_row + 2) * kStep + margin_px));
  glance.roi.row_px = top;
  glance.roi.rows_px = std::max(bottom - top, 2);
  return glance;
}

}  // namespace sightline
