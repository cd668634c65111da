// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/block_means.h"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cassert>
#include <cmath>

#include "render_worker/optics/pupil.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/sensor/expose.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {
namespace {

constexpr double kTransportError = 0.02;
// Above this part of the full charge speckle may be cut: exp(-12) for full contrast.
constexpr double kFarFromFull = 1.0 / 12;

}  // namespace

BlockMeans::BlockMeans(const RecordedScene& scene, int recordings, int block_px, int tile_blocks,
                       double registration_px)
    : sensor_(*scene.inspection.sensor),
      block_px_(block_px),
      tile_blocks_(tile_blocks),
      rows_(scene.inspection.rig.camera.rows_px / block_px),
      columns_(scene.inspection.rig.camera.columns_px / block_px),
      recordings_(recordings),
      registration_px_(registration_px) {
  full_electrons_ =
      std::min(sensor_.saturation_capacity_electrons,
               (sensor_.largest_dn() - sensor_.black_level_dn) / sensor_.gain_dn_per_electron) -
      sensor_.dark_mean_electrons;
  observed_dn_ = Eigen::VectorXd::Zero(count());
  for (int r = 0; r < recordings_; ++r) {
    const Image<uint16_t>& raw = scene.raw_dn[static_cast<size_t>(r)];
    for (int i = 0; i < rows_ * block_px_; ++i) {
      for (int j = 0; j < columns_ * block_px_; ++j) {
        observed_dn_[Index(r, i / block_px_, j / block_px_)] += raw.At(i, j);
      }
    }
    const RecordedImage& recorded = scene.recordings.recordings[static_cast<size_t>(r)];
    Inspection inspection = scene.inspection;
    inspection.rig.lens->f_number = recorded.f_number;
    const FrameSetup frame =
        PartFrameSetup(inspection, {recorded.measurement, recorded.stage_position_m});
    dark_electrons_.push_back(sensor_.dark_mean_electrons + DarkCurrentElectrons(frame));
    const double speckle_px = frame.laser.wavelength_m * frame.ImageDistance() /
                              frame.PupilDiameter() / sensor_.pixel_pitch_m;
    // The Airy pattern's first dark ring is at 1.22.
    max_lag_ = std::max(max_lag_, std::clamp(static_cast<int>(std::ceil(1.22 * speckle_px)), 1, 6));
    const double patterns = static_cast<double>(frame.speckle_pattern_weights.size());
    const SpecklePixelCovariance covariance(
        MakePupil(frame.lens), [](double, double) { return 1.0; }, frame.laser.wavelength_m,
        frame.ImageDistance(), sensor_.pixel_pitch_m, 6);
    Image<double> speckle(13, 13);
    for (int i = -6; i <= 6; ++i) {
      for (int j = -6; j <= 6; ++j) {
        speckle.At(i + 6, j + 6) = covariance.At(std::abs(i), std::abs(j)) / patterns;
      }
    }
    contrast_squared_.push_back(covariance.At(0, 0) / patterns);
    speckle_.push_back(std::move(speckle));
  }
  observed_dn_ /= static_cast<double>(block_px_ * block_px_);
}

bool BlockMeans::HeldOut(int index) const {
  const int column = index % columns_, row = index / columns_ % rows_;
  return (row / tile_blocks_ + column / tile_blocks_) % 2 == 1;
}

Eigen::VectorXd BlockMeans::PathElectrons(const LightPath& path) const {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(count());
  for (int r = 0; r < recordings_; ++r) {
    const Image<double>& image = path.electrons[static_cast<size_t>(r)];
    for (int i = 0; i < rows_ * block_px_; ++i) {
      for (int j = 0; j < columns_ * block_px_; ++j) {
        mean[Index(r, i / block_px_, j / block_px_)] += image.At(i, j);
      }
    }
  }
  return mean / (block_px_ * block_px_);
}

ExpectedBlocks BlockMeans::Expect(const PathChoice& paths, const Eigen::VectorXd& factors) const {
  assert(static_cast<Eigen::Index>(paths.size()) == factors.size());
  const auto path_count = static_cast<int>(paths.size());
  const double pixels = block_px_ * block_px_;
  const double gain = sensor_.gain_dn_per_electron;
  ExpectedBlocks expected;
  expected.mean_dn = Eigen::VectorXd::Zero(count());
  expected.speckle_variance_dn2 = Eigen::VectorXd::Zero(count());
  expected.other_variance_dn2 = Eigen::VectorXd::Zero(count());
  expected.jacobian_dn = Eigen::MatrixXd::Zero(count(), path_count);
  const double noise = sensor_.dark_noise_electrons * sensor_.dark_noise_electrons;
  Image<double> laser(columns_ * block_px_, rows_ * block_px_);
  Image<double> all = laser, afar = laser, laser_slope = laser, other_slope = laser;
  for (int r = 0; r < recordings_; ++r) {
    std::fill(laser.values.begin(), laser.values.end(), 0);
    std::fill(all.values.begin(), all.values.end(), 0);
    std::fill(afar.values.begin(), afar.values.end(), 0);
    for (int k = 0; k < path_count; ++k) {
      const Image<double>& image = paths[k]->electrons[static_cast<size_t>(r)];
      for (int i = 0; i < all.rows_px; ++i) {
        const double* from = image.Row(i);
        double* sum = all.Row(i);
        double* speckled = laser.Row(i);
        for (int j = 0; j < all.columns_px; ++j) {
          sum[j] += factors[k] * from[j];
          if (paths[k]->laser_light) speckled[j] += factors[k] * from[j];
        }
      }
      if (paths[k]->diffracted_electrons.empty()) continue;
      const Image<double>& diffracted = paths[k]->diffracted_electrons[static_cast<size_t>(r)];
      for (int i = 0; i < all.rows_px; ++i) {
        for (int j = 0; j < all.columns_px; ++j) afar.At(i, j) += factors[k] * diffracted.At(i, j);
      }
    }
    // Pixel by pixel: mean after clipping, and by how much it follows laser and other light.
    const double shape = 1 / contrast_squared_[static_cast<size_t>(r)];
    for (int i = 0; i < all.rows_px; ++i) {
      for (int j = 0; j < all.columns_px; ++j) {
        double& mean = all.At(i, j);
        double& coherent = laser.At(i, j);
        laser_slope.At(i, j) = other_slope.At(i, j) = 1;
        if (mean <= kFarFromFull * full_electrons_ || coherent <= 0) continue;
        // Mean of min(x, full) for x of a Gamma law.
        const double full = full_electrons_ - (mean - coherent);
        const double below = boost::math::gamma_p(shape, shape * full / coherent);
        const double light_below = boost::math::gamma_p(shape + 1, shape * full / coherent);
        mean = coherent * light_below + full * (1 - below) + (mean - coherent);
        laser_slope.At(i, j) = light_below;
        other_slope.At(i, j) = below;
        coherent *= light_below;
        afar.At(i, j) *= light_below;
      }
    }
    for (int k = 0; k < path_count; ++k) {
      const Image<double>& image = paths[k]->electrons[static_cast<size_t>(r)];
      const Image<double>& slope = paths[k]->laser_light ? laser_slope : other_slope;
      for (int i = 0; i < all.rows_px; ++i) {
        for (int j = 0; j < all.columns_px; ++j) {
          expected.jacobian_dn(Index(r, i / block_px_, j / block_px_), k) +=
              slope.At(i, j) * image.At(i, j) * gain / pixels;
        }
      }
    }
    const Image<double>& speckle = speckle_[static_cast<size_t>(r)];
    // Of streaks that cross the block: pixels differ along one side only.
    double streaks = 0;
    for (int n = 0; n < block_px_; ++n) {
      for (int m = 0; m < block_px_; ++m) {
        if (std::abs(n - m) <= 6) streaks += speckle.At(6, 6 + n - m) / (block_px_ * block_px_);
      }
    }
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        const int top = row * block_px_, left = column * block_px_;
        double sum = 0, speckle_sum = 0, afar_sum = 0, photons = 0;
        for (int i = top; i < top + block_px_; ++i) {
          for (int j = left; j < left + block_px_; ++j) {
            sum += all.At(i, j);
            photons += std::max(0.0, all.At(i, j)) * other_slope.At(i, j);
            const double own = laser.At(i, j), own_afar = afar.At(i, j);
            afar_sum += own_afar;
            if (own == 0) continue;
            // Fields of both add up: what remains of the product is correlated as usual.
            const auto product = [&](int m, int n) {
              return own * laser.At(m, n) - own_afar * afar.At(m, n);
            };
            const int last_i = std::min(i + max_lag_, top + block_px_ - 1);
            const int first_j = std::max(j - max_lag_, left);
            const int last_j = std::min(j + max_lag_, left + block_px_ - 1);
            speckle_sum += product(i, j) * speckle.At(6, 6);
            for (int n = j + 1; n <= last_j; ++n) {
              speckle_sum += 2 * product(i, n) * speckle.At(6, 6 + n - j);
            }
            for (int m = i + 1; m <= last_i; ++m) {
              for (int n = first_j; n <= last_j; ++n) {
                speckle_sum += 2 * product(m, n) * speckle.At(6 + m - i, 6 + n - j);
              }
            }
          }
        }
        // The block's mean changes by what its edges take in and lose.
        double down = 0, right = 0;
        for (int n = 0; n < block_px_; ++n) {
          down +=
              all.At(std::min(top + block_px_, all.rows_px - 1), left + n) - all.At(top, left + n);
          right += all.At(top + n, std::min(left + block_px_, all.columns_px - 1)) -
                   all.At(top + n, left);
        }
        const double moved = registration_px_ * std::hypot(down, right) / pixels;
        const double mean = sum / pixels;
        const int index = Index(r, row, column);
        expected.mean_dn[index] =
            gain * (mean + dark_electrons_[static_cast<size_t>(r)]) + sensor_.black_level_dn;
        expected.speckle_variance_dn2[index] =
            gain * gain * (speckle_sum + streaks * afar_sum * afar_sum) / (pixels * pixels);
        expected.other_variance_dn2[index] =
            gain * gain *
                (photons / (pixels * pixels) + noise / pixels + moved * moved +
                 kTransportError * kTransportError * mean * mean) +
            1 / (12 * pixels);
      }
    }
  }
  return expected;
}

}  // namespace sightline
