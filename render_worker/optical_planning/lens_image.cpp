// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/lens_image.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/status/status.h"
#include "core/status/status_macros.h"
#include "render_worker/optics/circle_of_confusion.h"
#include "render_worker/optics/incoherent_imaging.h"
#include "render_worker/optics/laser_imaging.h"
#include "render_worker/optics/parallel_rows.h"
#include "render_worker/render/memory_estimate.h"
#include "render_worker/render/part_view.h"

namespace sightline {
namespace {

// Laser light darker than this share of the line is imaged without speckle.
constexpr double kSpeckleShare = 1e-3;
// Layers of depth are then no more than a tenth of a wave from their light: well below what an
// image just begins to show (Rayleigh's criterion, a quarter).
constexpr double kLayerStepWaves = 0.2;
// Fraction of the energy that diffraction may bring in from beyond the margin.
constexpr double kLostEnergy = 0.01;
constexpr int kLargestMargin_px = 160;
// Approximate bytes of a sample of the laser grid's arrays: irradiance, depth and layer.
constexpr int64_t kBytesPerSample = 12;
constexpr int64_t kStripBytes = int64_t{512} << 20;
constexpr int kNarrowestStrip_px = 32;

// Weights of Catmull and Rom's cubic for the four samples about a place, `part` in [0, 1) behind
// the second of them: exact for parabolas, so sampled profiles keep their width.
struct CubicWeights {
  float w[4];
  explicit CubicWeights(float part) {
    const float t = part, t2 = t * t, t3 = t2 * t;
    w[0] = 0.5F * (-t3 + 2 * t2 - t);
    w[1] = 0.5F * (3 * t3 - 5 * t2 + 2);
    w[2] = 0.5F * (-3 * t3 + 4 * t2 + t);
    w[3] = 0.5F * (t3 - t2);
  }
};

// Positions of a fine grid's samples on a coarse one.
struct Place {
  int first = 0;  // of four coarse samples
  int nearest = 0;
  CubicWeights weights{0};
};
// `first_px`: pixel of the coarse grid's region at which the fine one's begins.
std::vector<Place> Places(int fine_samples, int fine_margin_px, int fine_per_px, int first_px,
                          int coarse_samples, int coarse_margin_px, int coarse_per_px) {
  std::vector<Place> places(static_cast<size_t>(fine_samples));
  for (int i = 0; i < fine_samples; ++i) {
    const double at =
        ((i + 0.5) / fine_per_px - fine_margin_px + first_px + coarse_margin_px) * coarse_per_px -
        0.5;
    const int before = static_cast<int>(std::floor(at));
    Place& place = places[static_cast<size_t>(i)];
    place.first = before - 1;
    place.weights = CubicWeights(static_cast<float>(at - before));
    place.nearest = std::clamp(static_cast<int>(std::lround(at)), 0, coarse_samples - 1);
  }
  return places;
}

class LensImage {
 public:
  LensImage(const FrameLight& light, const FrameSetup& frame, std::span<const ActiveEffect> effects,
            const RenderLimits& limits)
      : light_(light),
        frame_(frame),
        effects_(effects),
        limits_(limits),
        optics_(MakeOpticsModel(frame, effects)),
        factor_(frame, light.chief_distance_m),
        power_(light.laser_power_w > 0 ? frame.laser.power_w / light.laser_power_w : 0) {
    optics_.layer_step_waves = kLayerStepWaves;
  }

  absl::StatusOr<std::vector<PixelIrradiance>> Run(std::span<const uint64_t> seeds) {
    const double brightest =
        power_ * *std::max_element(light_.laser_radiance_w_m2_sr.values.begin(),
                                   light_.laser_radiance_w_m2_sr.values.end());
    // Relative to the line as it is, not to a glint on it.
    threshold_ = static_cast<float>(
        kSpeckleShare *
        std::min(brightest, power_ * std::max(light_.median_line_radiance_w_m2_sr, 1e-30)));
    return effects_.empty() ? InStrips(seeds) : AsAWhole(seeds);
  }

 private:
  SpeckleModel Speckle(uint64_t seed) const {
    SpeckleModel speckle;
    speckle.seed = seed;
    speckle.pattern_weights = frame_.speckle_pattern_weights;
    speckle.on = frame_.speckle;
    return speckle;
  }

  int64_t StripBytes() const { return std::min(kStripBytes, limits_.max_image_bytes / 8); }

  bool Cancelled() const { return limits_.cancelled != nullptr && *limits_.cancelled; }

  void Report(double fraction) const {
    if (limits_.progress) limits_.progress(fraction);
  }

  // Without effects the image falls into strips of columns, so that memory does not grow with it;
  // the scatterers are a function of the place, so strips fit together.
  absl::StatusOr<std::vector<PixelIrradiance>> InStrips(std::span<const uint64_t> seeds) {
    IdealImage ideal = Incoherent();
    PixelIrradiance common;
    common.roi = frame_.roi;
    common.laser_irradiance_w_m2 = DimLaser();
    if (common.laser_irradiance_w_m2.empty()) {
      common.laser_irradiance_w_m2 = Image<float>(frame_.roi.columns_px, frame_.roi.rows_px);
    }
    for (size_t channel = 0; channel < light_.channel_radiance.size(); ++channel) {
      common.incoherent_electron_flux_m2_s[channel] =
          ImageIncoherent(ideal.incoherent_electron_flux_m2_s[channel], ideal.incoherent_grid,
                          ideal.incoherent_wavelength_m[channel], optics_, limits_.threads);
      ideal.incoherent_electron_flux_m2_s[channel] = {};
    }
    std::vector<PixelIrradiance> images(seeds.size(), common);
    if (!frame_.laser_on || !frame_.shutter_open) return images;
    const SubPixelGrid whole = LaserGrid();
    const int64_t column_bytes = kBytesPerSample * whole.sub_pixels * whole.sub_pixels *
                                 (whole.roi.rows_px + 2 * whole.margin_px);
    const int columns = static_cast<int>(std::clamp<int64_t>(
        StripBytes() / column_bytes - int64_t{2} * whole.margin_px, kNarrowestStrip_px, 1 << 20));
    for (int first = 0; first < whole.roi.columns_px; first += columns) {
      SubPixelGrid strip = whole;
      strip.roi.column_px += first;
      strip.roi.columns_px = std::min(columns, whole.roi.columns_px - first);
      SIGHTLINE_RETURN_IF_ERROR(CheckFrameBytes(FrameBytes(strip, {}, 0), limits_.max_image_bytes,
                                                frame_, strip.sub_pixels, "image"));
      AddLaser(strip, first, &ideal);
      for (size_t r = 0; r < seeds.size(); ++r) {
        if (Cancelled()) return absl::CancelledError("cancelled");
        Report((first +
                strip.roi.columns_px * static_cast<double>(r) / static_cast<double>(seeds.size())) /
               whole.roi.columns_px);
        const Image<float> part = ImageLaser(ideal, optics_, Speckle(seeds[r]), limits_.threads);
        for (int row = 0; row < part.rows_px; ++row) {
          float* to = images[r].laser_irradiance_w_m2.Row(row) + first;
          for (int column = 0; column < part.columns_px; ++column) {
            to[column] += part.At(row, column);
          }
        }
      }
    }
    return images;
  }

  absl::StatusOr<std::vector<PixelIrradiance>> AsAWhole(std::span<const uint64_t> seeds) {
    IdealImage ideal = Incoherent();
    const SubPixelGrid grid = LaserGrid();
    const int channels = static_cast<int>(light_.channel_radiance.size());
    SIGHTLINE_RETURN_IF_ERROR(CheckFrameBytes(FrameBytes(grid, light_.incoherent_grid, channels),
                                              limits_.max_image_bytes, frame_, grid.sub_pixels,
                                              "image"));
    AddLaser(grid, 0, &ideal);
    for (const ActiveEffect& active : effects_) {
      active.effect->OnIdealImage(ideal, frame_, active.parameters);
    }
    const Image<float> dim = DimLaser();
    std::vector<PixelIrradiance> images;
    for (const uint64_t seed : seeds) {
      if (Cancelled()) return absl::CancelledError("cancelled");
      Report(static_cast<double>(images.size()) / static_cast<double>(seeds.size()));
      SIGHTLINE_ASSIGN_OR_RETURN(
          auto formed, FormLight(ideal, frame_, effects_, Speckle(seed), limits_.threads));
      for (size_t i = 0; i < dim.values.size(); ++i) {
        formed.laser_irradiance_w_m2.values[i] += dim.values[i];
      }
      images.push_back(std::move(formed));
    }
    return images;
  }

  float RadiusPx(double depth_m, double u_m, double v_m) const {
    return static_cast<float>(0.5 * frame_.PupilDiameter() * frame_.ImageDistance() *
                              std::abs(optics_.curvature(depth_m, u_m, v_m)) /
                              frame_.sensor.pixel_pitch_m);
  }

  // Radii of the circles of confusion at the pixels of a grid of whole pixels.
  Image<float> Radii(const SubPixelGrid& grid) const {
    Image<float> radii(grid.columns(), grid.rows());
    const SubPixelGrid& fine = light_.grid;
    for (int i = 0; i < radii.rows_px; ++i) {
      const int row =
          std::clamp((i - grid.margin_px + fine.margin_px) * fine.sub_pixels + fine.sub_pixels / 2,
                     0, fine.rows() - 1);
      for (int j = 0; j < radii.columns_px; ++j) {
        const int column = std::clamp(
            (j - grid.margin_px + fine.margin_px) * fine.sub_pixels + fine.sub_pixels / 2, 0,
            fine.columns() - 1);
        radii.At(i, j) = RadiusPx(light_.depth_m.At(row, column), grid.U(j), grid.V(i));
      }
    }
    return radii;
  }

  void Scale(const SubPixelGrid& grid, Image<float>* image) const {
    for (int i = 0; i < image->rows_px; ++i) {
      for (int j = 0; j < image->columns_px; ++j) {
        image->At(i, j) *= static_cast<float>(factor_(grid.U(j), grid.V(i)));
      }
    }
  }

  IdealImage Incoherent() const {
    IdealImage ideal;
    ideal.incoherent_grid = light_.incoherent_grid;
    ideal.incoherent_wavelength_m = light_.incoherent_wavelength_m;
    ideal.constant_depth_m = light_.median_line_depth_m;
    if (light_.channel_radiance.empty()) return ideal;
    const Image<float> radii = Radii(light_.incoherent_grid);
    for (size_t channel = 0; channel < light_.channel_radiance.size(); ++channel) {
      Image<float> flux = SpreadByDefocus(light_.channel_radiance[channel], radii, limits_.threads);
      Scale(light_.incoherent_grid, &flux);
      ideal.incoherent_electron_flux_m2_s[channel] = std::move(flux);
    }
    return ideal;
  }

  // Sub-pixels that the pupil needs, and the margin from which light comes in.
  SubPixelGrid LaserGrid() const {
    const auto [nearest, farthest] =
        std::minmax_element(light_.depth_m.values.begin(), light_.depth_m.values.end());
    double curvature = 0;
    const RegionOfInterest& roi = frame_.roi;
    const double p = frame_.sensor.pixel_pitch_m;
    for (const float depth : {*nearest, *farthest}) {
      for (const double u : {roi.column_px * p, (roi.column_px + roi.columns_px) * p}) {
        for (const double v : {roi.row_px * p, (roi.row_px + roi.rows_px) * p}) {
          curvature = std::max(curvature, std::abs(optics_.curvature(depth, u, v)));
        }
      }
    }
    SubPixelGrid grid = MakeSubPixelGrid(frame_, optics_, curvature, kLostEnergy);
    grid.margin_px = std::min(grid.margin_px, light_.grid.margin_px);
    return grid;
  }

  // Laser light that has speckle, and the depths, on a grid that begins at a column of the region.
  void AddLaser(const SubPixelGrid& grid, int first_column_px, IdealImage* ideal) const {
    ideal->grid = grid;
    ideal->laser_irradiance_w_m2 = Image<float>(grid.columns(), grid.rows());
    ideal->depth_m = Image<float>(grid.columns(), grid.rows());
    const SubPixelGrid& coarse = light_.grid;
    const std::vector<Place> columns =
        Places(grid.columns(), grid.margin_px, grid.sub_pixels, first_column_px, coarse.columns(),
               coarse.margin_px, coarse.sub_pixels);
    const std::vector<Place> rows = Places(grid.rows(), grid.margin_px, grid.sub_pixels, 0,
                                           coarse.rows(), coarse.margin_px, coarse.sub_pixels);
    const Image<float>& radiance = light_.laser_radiance_w_m2_sr;
    const auto power = static_cast<float>(power_);
    ForIndexRanges(limits_.threads, grid.rows(), [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const Place& row = rows[static_cast<size_t>(i)];
        const float* samples[4];
        for (int k = 0; k < 4; ++k) {
          samples[k] = radiance.Row(std::clamp(row.first + k, 0, coarse.rows() - 1));
        }
        const float* nearest_row = radiance.Row(row.nearest);
        const float* depths = light_.depth_m.Row(row.nearest);
        float* light_out = ideal->laser_irradiance_w_m2.Row(i);
        float* depth_out = ideal->depth_m.Row(i);
        for (int j = 0; j < grid.columns(); ++j) {
          const Place& column = columns[static_cast<size_t>(j)];
          depth_out[j] = depths[column.nearest];
          // A sample counts as dim if the nearest coarse sample is dim.
          if (power * nearest_row[column.nearest] < threshold_) continue;
          float sum = 0;
          for (int k = 0; k < 4; ++k) {
            float along = 0;
            for (int l = 0; l < 4; ++l) {
              const int c = std::clamp(column.first + l, 0, coarse.columns() - 1);
              along += column.weights.w[l] * samples[k][c];
            }
            sum += row.weights.w[k] * along;
          }
          light_out[j] =
              std::max(power * sum, 0.F) * static_cast<float>(factor_(grid.U(j), grid.V(i)));
        }
      }
    });
  }

  // The rest of the laser light: irradiance of the pixels, empty if there is none.
  Image<float> DimLaser() const {
    const SubPixelGrid& fine = light_.grid;
    SubPixelGrid pixels = fine;
    pixels.sub_pixels = 1;
    Image<float> dim(pixels.columns(), pixels.rows());
    const int s = fine.sub_pixels;
    const auto power = static_cast<float>(power_);
    bool any = false;
    for (int i = 0; i < fine.rows(); ++i) {
      const float* row = light_.laser_radiance_w_m2_sr.Row(i);
      for (int j = 0; j < fine.columns(); ++j) {
        const float value = power * row[j];
        if (value >= threshold_ || !(value > 0)) continue;
        dim.At(i / s, j / s) += value / static_cast<float>(s * s);
        any = true;
      }
    }
    if (!any || !frame_.laser_on || !frame_.shutter_open) return {};
    dim = SpreadByDefocus(dim, Radii(pixels), limits_.threads);
    Scale(pixels, &dim);
    return ImageIncoherent(dim, pixels, frame_.laser.wavelength_m, optics_, limits_.threads);
  }

  const FrameLight& light_;
  const FrameSetup& frame_;
  std::span<const ActiveEffect> effects_;
  const RenderLimits& limits_;
  OpticsModel optics_;
  IrradianceFactor factor_;
  double power_;
  float threshold_ = 0;
};

}  // namespace

absl::StatusOr<std::vector<PixelIrradiance>> ImageThroughLens(
    const FrameLight& light, const FrameSetup& frame, std::span<const ActiveEffect> effects,
    std::span<const uint64_t> speckle_seeds, const RenderLimits& limits) {
  return LensImage(light, frame, effects, limits).Run(speckle_seeds);
}

int LensMarginPx(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                 std::span<const double> depths_m) {
  const OpticsModel optics = MakeOpticsModel(frame, effects);
  double curvature = 0;
  for (const double depth : depths_m) {
    curvature = std::max(curvature, std::abs(optics.curvature(depth, 0, 0)));
  }
  return std::min(MakeSubPixelGrid(frame, optics, curvature, kLostEnergy).margin_px,
                  kLargestMargin_px);
}

}  // namespace sightline
