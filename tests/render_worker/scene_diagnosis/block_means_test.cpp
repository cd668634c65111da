// SPDX-License-Identifier: Apache-2.0
// Statistics of block means, compared with many renderings with other speckle and noise.
#include "render_worker/scene_diagnosis/block/block_means.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "render_worker/scene_diagnosis/light_paths.h"
#include "tests/render_worker/scene_diagnosis/groove_scene.h"

namespace sightline {
namespace {

// Residuals of the right model have mean 0 and mean square 1 over blocks and speckle patterns.
TEST(BlockMeans, ResidualsOfTheRightModelAreStandard) {
  RecordedScene scene = GrooveScene();
  LightPathSettings tracing;
  double sum = 0, squares = 0;
  int count = 0;
  std::optional<SceneLight> light;
  for (const int seed : {1, 2, 3, 4}) {
    ASSERT_NO_FATAL_FAILURE(Record(&scene, scene.inspection, {}, seed));
    if (!light) {
      auto traced = TraceLightPaths(scene, tracing);
      ASSERT_TRUE(traced.ok()) << traced.status();
      light = *std::move(traced);
    }
    // The images lie exactly where the model has them.
    const BlockMeans blocks(scene, 1, 8, 4, /*registration_px=*/0);
    PathChoice nominal;
    Eigen::VectorXd factors(2);
    factors << 1, 0;
    for (const LightPath& path : light->paths) {
      if (path.nominal) nominal.push_back(&path);
    }
    ASSERT_EQ(nominal.size(), 2U);
    const ExpectedBlocks expected = blocks.Expect(nominal, factors);
    for (int b = 0; b < blocks.grid().count(); ++b) {
      const double z = (blocks.observed_dn()[b] - expected.mean_dn[b]) /
                       std::sqrt(expected.speckle_variance_dn2[b] + expected.other_variance_dn2[b]);
      sum += z;
      squares += z * z;
      ++count;
    }
  }
  // Standard errors 1/sqrt(n) and sqrt(2/n) for normal residuals; blocks on the line have few
  // speckles and correlate with their neighbours, hence twice as much.
  EXPECT_NEAR(sum / count, 0, 4 * 2 / std::sqrt(count));
  EXPECT_NEAR(squares / count, 1, 4 * 2 * std::sqrt(2.0 / count));
}

TEST(BlockMeans, JacobianIsTheDerivativeOfTheMean) {
  RecordedScene scene = GrooveScene();
  scene.recordings.recordings.pop_back();
  scene.recordings.recordings[0].exposure_time_s *= 5;  // some pixels are cut
  scene.raw_dn.assign(1, Image<uint16_t>(128, 96));
  auto light = TraceLightPaths(scene, {});
  ASSERT_TRUE(light.ok()) << light.status();
  const BlockMeans blocks(scene, 1, 8, 4, 0);
  PathChoice paths;
  for (const LightPath& path : light->paths) {
    if (path.nominal || path.effect == "illumination.interreflection") paths.push_back(&path);
  }
  Eigen::VectorXd factors(3);
  factors << 1, 0, 1;
  const ExpectedBlocks at = blocks.Expect(paths, factors);
  for (int k = 0; k < 3; ++k) {
    constexpr double kStep = 1e-4;
    Eigen::VectorXd more = factors, less = factors;
    more[k] += kStep;
    less[k] -= kStep;
    const Eigen::VectorXd slope =
        (blocks.Expect(paths, more).mean_dn - blocks.Expect(paths, less).mean_dn) / (2 * kStep);
    // The mean is piecewise linear: a level of speckle that crosses the limit between the two adds
    // at most its share of a pixel.
    const double scale = at.jacobian_dn.col(k).cwiseAbs().maxCoeff();
    EXPECT_LT((slope - at.jacobian_dn.col(k)).cwiseAbs().maxCoeff(), 0.01 * scale) << k;
  }
}

}  // namespace
}  // namespace sightline
