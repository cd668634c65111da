// SPDX-License-Identifier: Apache-2.0
// Means over square blocks of pixels, recorded and expected: what a model without the realisation
// of speckle can predict.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// Light paths with their factors' places in a parameter vector.
using PathChoice = std::vector<const LightPath*>;

struct ExpectedBlocks {
  Eigen::VectorXd mean_dn;
  // Variance of the block's mean: of fully developed speckle, and of all else.
  Eigen::VectorXd speckle_variance_dn2;
  Eigen::VectorXd other_variance_dn2;
  Eigen::MatrixXd jacobian_dn;  // of the mean by the factors
};

class BlockMeans {
 public:
  // Of the first `recordings` of the scene. `block_px` on a side; `tile_blocks` x `tile_blocks`
  // blocks are a tile, every other of which, like the black fields of a chessboard, is held out.
  // Pixels beyond the last whole block are left out. `registration_px`: standard uncertainty of
  // where the model's image lies on the recorded one.
  BlockMeans(const RecordedScene& scene, int recordings, int block_px, int tile_blocks,
             double registration_px);

  int count() const { return recordings_ * rows_ * columns_; }
  int recordings() const { return recordings_; }
  int rows() const { return rows_; }
  int columns() const { return columns_; }
  int block_px() const { return block_px_; }
  int Index(int recording, int row, int column) const {
    return (recording * rows_ + row) * columns_ + column;
  }
  bool HeldOut(int index) const;
  const Eigen::VectorXd& observed_dn() const { return observed_dn_; }

  // Of the sum of factor times path. Mean: clipping at saturation averaged over the speckle of a
  // pixel, which follows a Gamma law (Goodman, Speckle Phenomena in Optics, 2nd ed., 4.7.2).
  // Variance: speckle with the pupil's correlation between pixels, photons, dark noise and
  // quantisation (EMVA 1288 R4.0, section 2), the image's place, and 2 % for the noise of light
  // transport.
  ExpectedBlocks Expect(const PathChoice& paths, const Eigen::VectorXd& factors) const;
  // Mean electrons of a path in every block at factor 1.
  Eigen::VectorXd PathElectrons(const LightPath& path) const;

 private:
  const Sensor sensor_;
  int block_px_, tile_blocks_, rows_, columns_, recordings_;
  double registration_px_;
  double full_electrons_;  // charge at which the raw number or the pixel is full
  int max_lag_ = 1;
  std::vector<double> dark_electrons_;  // mean, by recording
  // By recording: covariance of the irradiance of pixels over the product of means, (2 max_lag + 1)
  // squared; its value at lag 0.
  std::vector<Image<double>> speckle_;
  std::vector<double> contrast_squared_;
  Eigen::VectorXd observed_dn_;
};

}  // namespace sightline
