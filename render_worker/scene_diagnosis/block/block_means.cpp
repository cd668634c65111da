// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/block/block_means.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "render_worker/optics/pupil.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/scene_diagnosis/block/block_moments.h"
#include "render_worker/sensor/expose.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {
namespace {

// Standard deviation of the noise of light transport over the mean [1]: the default of
// render.noise_target_relative (core/inspection/inspection.h).
constexpr double kTransportError = 0.02;
// First dark ring of the Airy pattern over lambda b / D (Born and Wolf, section 8.5.2).
constexpr double kAiryRadius = 1.22;

// Sums over the pixels of every block of one image, added to `sums`.
template <typename T>
void AddPixels(const Image<T>& image, const BlockGrid& grid, int recording, Eigen::VectorXd* sums) {
  for (int i = 0; i < grid.rows_px(); ++i) {
    for (int j = 0; j < grid.columns_px(); ++j) {
      (*sums)[grid.Index(recording, i / grid.block_px, j / grid.block_px)] += image.At(i, j);
    }
  }
}

// Photo-electrons at which the pixel's well or the largest raw number is reached.
double FullElectrons(const Sensor& sensor) {
  return std::min(sensor.saturation_capacity_electrons,
                  (sensor.largest_dn() - sensor.black_level_dn) / sensor.gain_dn_per_electron) -
         sensor.dark_mean_electrons;
}

}  // namespace

BlockMeans::BlockMeans(const RecordedScene& scene, int recordings, int block_px, int tile_blocks,
                       double registration_px)
    : sensor_(*scene.inspection.sensor),
      grid_{.recordings = recordings,
            .rows = scene.inspection.rig.camera.rows_px / block_px,
            .columns = scene.inspection.rig.camera.columns_px / block_px,
            .block_px = block_px,
            .tile_blocks = tile_blocks},
      registration_px_(registration_px),
      full_electrons_(FullElectrons(sensor_)) {
  observed_dn_ = Eigen::VectorXd::Zero(grid_.count());
  for (int r = 0; r < recordings; ++r) {
    const auto index = static_cast<size_t>(r);
    AddPixels(scene.raw_dn[index], grid_, r, &observed_dn_);
    optics_.push_back(OpticsOf(scene, scene.recordings.recordings[index]));
    max_lag_px_ = std::max(max_lag_px_, optics_.back().reach_px);
  }
  observed_dn_ /= static_cast<double>(block_px * block_px);
}

BlockMeans::RecordingOptics BlockMeans::OpticsOf(const RecordedScene& scene,
                                                 const RecordedImage& recorded) {
  const Sensor& sensor = *scene.inspection.sensor;
  Inspection inspection = scene.inspection;
  inspection.rig.lens->f_number = recorded.f_number;
  const FrameSetup frame =
      PartFrameSetup(inspection, {recorded.measurement, recorded.stage_position_m});
  RecordingOptics optics;
  optics.dark_electrons = sensor.dark_mean_electrons + DarkCurrentElectrons(frame);
  const double speckle_px = frame.laser.wavelength_m * frame.ImageDistance() /
                            frame.PupilDiameter() / sensor.pixel_pitch_m;
  optics.reach_px =
      std::clamp(static_cast<int>(std::ceil(kAiryRadius * speckle_px)), 1, kLargestLag_px);
  const double patterns = static_cast<double>(frame.speckle_pattern_weights.size());
  const SpecklePixelCovariance covariance(
      MakePupil(frame.lens), [](double, double) { return 1.0; }, frame.laser.wavelength_m,
      frame.ImageDistance(), sensor.pixel_pitch_m, kLargestLag_px);
  constexpr int kLags = 2 * kLargestLag_px + 1;
  optics.speckle_covariance = Image<double>(kLags, kLags);
  for (int i = -kLargestLag_px; i <= kLargestLag_px; ++i) {
    for (int j = -kLargestLag_px; j <= kLargestLag_px; ++j) {
      optics.speckle_covariance.At(i + kLargestLag_px, j + kLargestLag_px) =
          covariance.At(std::abs(i), std::abs(j)) / patterns;
    }
  }
  optics.contrast_squared = covariance.At(0, 0) / patterns;
  return optics;
}

Eigen::VectorXd BlockMeans::PathElectrons(const LightPath& path) const {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(grid_.count());
  for (int r = 0; r < grid_.recordings; ++r) {
    AddPixels(path.electrons[static_cast<size_t>(r)], grid_, r, &mean);
  }
  return mean / (grid_.block_px * grid_.block_px);
}

ExpectedBlocks BlockMeans::Expect(const PathChoice& paths, const Eigen::VectorXd& factors) const {
  assert(static_cast<Eigen::Index>(paths.size()) == factors.size());
  ExpectedBlocks expected;
  expected.mean_dn = Eigen::VectorXd::Zero(grid_.count());
  expected.speckle_variance_dn2 = Eigen::VectorXd::Zero(grid_.count());
  expected.other_variance_dn2 = Eigen::VectorXd::Zero(grid_.count());
  expected.jacobian_dn =
      Eigen::MatrixXd::Zero(grid_.count(), static_cast<Eigen::Index>(paths.size()));
  for (int r = 0; r < grid_.recordings; ++r) {
    ExpectedPixels pixels = SumOfPaths(paths, factors, r, grid_);
    ClipAtFullCharge(full_electrons_, optics_[static_cast<size_t>(r)].contrast_squared, &pixels);
    AddDerivatives(r, pixels, paths, &expected);
    AddMoments(r, pixels, &expected);
  }
  return expected;
}

void BlockMeans::AddDerivatives(int recording, const ExpectedPixels& pixels,
                                const PathChoice& paths, ExpectedBlocks* expected) const {
  const double block_pixels = grid_.block_px * grid_.block_px;
  const double gain = sensor_.gain_dn_per_electron;
  for (size_t k = 0; k < paths.size(); ++k) {
    const Image<double>& image = paths[k]->electrons[static_cast<size_t>(recording)];
    const Image<double>& slope = paths[k]->laser_light ? pixels.laser_slope : pixels.other_slope;
    for (int i = 0; i < grid_.rows_px(); ++i) {
      for (int j = 0; j < grid_.columns_px(); ++j) {
        const int block = grid_.Index(recording, i / grid_.block_px, j / grid_.block_px);
        expected->jacobian_dn(block, static_cast<Eigen::Index>(k)) +=
            slope.At(i, j) * image.At(i, j) * gain / block_pixels;
      }
    }
  }
}

void BlockMeans::AddMoments(int recording, const ExpectedPixels& pixels,
                            ExpectedBlocks* expected) const {
  const RecordingOptics& optics = optics_[static_cast<size_t>(recording)];
  const double block_pixels = grid_.block_px * grid_.block_px;
  const double gain = sensor_.gain_dn_per_electron;
  const double dark_noise = sensor_.dark_noise_electrons * sensor_.dark_noise_electrons;
  const double streaks = StreakContrastSquared(optics.speckle_covariance, grid_.block_px);
  for (int row = 0; row < grid_.rows; ++row) {
    for (int column = 0; column < grid_.columns; ++column) {
      const PixelBlock block{row * grid_.block_px, column * grid_.block_px, grid_.block_px};
      const BlockSums sums = SumOverBlock(pixels, optics.speckle_covariance, max_lag_px_, block);
      const double moved = registration_px_ * ChangeWithMovement(pixels.all, block) / block_pixels;
      const double mean = sums.light / block_pixels;
      const int index = grid_.Index(recording, row, column);
      expected->mean_dn[index] = gain * (mean + optics.dark_electrons) + sensor_.black_level_dn;
      expected->speckle_variance_dn2[index] =
          gain * gain * (sums.speckle_variance + streaks * sums.diffracted * sums.diffracted) /
          (block_pixels * block_pixels);
      // Quantisation adds a uniform error of width 1 DN, of variance 1/12.
      expected->other_variance_dn2[index] =
          gain * gain *
              (sums.photon_variance / (block_pixels * block_pixels) + dark_noise / block_pixels +
               moved * moved + kTransportError * kTransportError * mean * mean) +
          1 / (12 * block_pixels);
    }
  }
}

}  // namespace sightline
