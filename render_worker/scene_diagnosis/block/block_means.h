// SPDX-License-Identifier: Apache-2.0
// Means of raw values over square blocks of pixels: a statistic that a model can predict without
// the realised speckle pattern. Recorded means are compared with their expectation and variance for
// given factors of the light paths.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/sensor/sensor.h"
#include "render_worker/scene_diagnosis/block/block_grid.h"
#include "render_worker/scene_diagnosis/block/expected_pixels.h"
#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// One element a block, in the order of BlockGrid::Index.
struct ExpectedBlocks {
  Eigen::VectorXd mean_dn;
  // Variance of the block's mean: of fully developed speckle, and of everything else.
  Eigen::VectorXd speckle_variance_dn2;
  Eigen::VectorXd other_variance_dn2;
  Eigen::MatrixXd jacobian_dn;  // derivative of the mean by the factors: blocks x paths
};

class BlockMeans {
 public:
  // Uses the first `recordings` of the scene. Blocks have `block_px` > 0 pixels on a side, tiles
  // `tile_blocks` > 0 blocks. `registration_px`: standard uncertainty of the position of the
  // model's image relative to the recorded one [px].
  BlockMeans(const RecordedScene& scene, int recordings, int block_px, int tile_blocks,
             double registration_px);

  const BlockGrid& grid() const { return grid_; }
  const Eigen::VectorXd& observed_dn() const { return observed_dn_; }

  // Moments of the block means if the light is sum_k factor_k path_k. `factors` has one element a
  // path. Mean: clipping at saturation averaged over the speckle of a pixel (ClipAtFullCharge).
  // Variance: speckle with the pupil's correlation between pixels, photons, dark noise and
  // quantisation (EMVA 1288 R4.0, section 2), registration, and the noise of light transport.
  ExpectedBlocks Expect(const PathChoice& paths, const Eigen::VectorXd& factors) const;
  // Mean photo-electrons of a path in every block at factor 1 [electrons].
  Eigen::VectorXd PathElectrons(const LightPath& path) const;

 private:
  // Optics and exposure of one recording.
  struct RecordingOptics {
    double dark_electrons = 0;  // mean of a pixel
    // Covariance of the irradiance of two pixels over the product of their means, by distance: lags
    // of -kLargestLag_px to kLargestLag_px in rows and columns.
    Image<double> speckle_covariance;
    double contrast_squared = 0;  // at lag 0
    int reach_px = 1;             // lags beyond it are left out
  };

  static RecordingOptics OpticsOf(const RecordedScene& scene, const RecordedImage& recorded);
  void AddDerivatives(int recording, const ExpectedPixels& pixels, const PathChoice& paths,
                      ExpectedBlocks* expected) const;
  void AddMoments(int recording, const ExpectedPixels& pixels, ExpectedBlocks* expected) const;

  const Sensor sensor_;
  BlockGrid grid_;
  double registration_px_;
  double full_electrons_ = 0;  // photo-electrons at saturation of the pixel or of the raw value
  int max_lag_px_ = 1;         // largest reach of the speckle of all recordings
  std::vector<RecordingOptics> optics_;
  Eigen::VectorXd observed_dn_;
};

}  // namespace sightline
