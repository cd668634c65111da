// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/block/expected_pixels.h"

#include <boost/math/special_functions/gamma.hpp>
#include <cstddef>

namespace sightline {
namespace {

// Below this fraction of the full charge clipping is negligible: at full contrast light exceeds
// twelve times its mean with probability exp(-12).
constexpr double kFarFromFull = 1.0 / 12;

void AddScaledPath(const LightPath& path, double factor, size_t recording, ExpectedPixels* pixels) {
  const Image<double>& image = path.electrons[recording];
  for (int i = 0; i < pixels->all.rows_px; ++i) {
    const double* from = image.Row(i);
    double* sum = pixels->all.Row(i);
    double* coherent = pixels->laser.Row(i);
    for (int j = 0; j < pixels->all.columns_px; ++j) {
      sum[j] += factor * from[j];
      if (path.laser_light) coherent[j] += factor * from[j];
    }
  }
  if (path.diffracted_electrons.empty()) return;
  const Image<double>& diffracted = path.diffracted_electrons[recording];
  for (int i = 0; i < pixels->all.rows_px; ++i) {
    for (int j = 0; j < pixels->all.columns_px; ++j) {
      pixels->diffracted.At(i, j) += factor * diffracted.At(i, j);
    }
  }
}

}  // namespace

ExpectedPixels SumOfPaths(const PathChoice& paths, const Eigen::VectorXd& factors, int recording,
                          const BlockGrid& grid) {
  const Image<double> zero(grid.columns_px(), grid.rows_px());
  const Image<double> one(grid.columns_px(), grid.rows_px(), 1);
  ExpectedPixels pixels{zero, zero, zero, one, one};
  for (size_t k = 0; k < paths.size(); ++k) {
    AddScaledPath(*paths[k], factors[static_cast<Eigen::Index>(k)], static_cast<size_t>(recording),
                  &pixels);
  }
  return pixels;
}

void ClipAtFullCharge(double full_electrons, double contrast_squared, ExpectedPixels* pixels) {
  const double shape = 1 / contrast_squared;
  for (int i = 0; i < pixels->all.rows_px; ++i) {
    for (int j = 0; j < pixels->all.columns_px; ++j) {
      double& mean = pixels->all.At(i, j);
      double& coherent = pixels->laser.At(i, j);
      if (mean <= kFarFromFull * full_electrons || coherent <= 0) continue;
      const double full = full_electrons - (mean - coherent);
      const double below = boost::math::gamma_p(shape, shape * full / coherent);
      const double light_below = boost::math::gamma_p(shape + 1, shape * full / coherent);
      mean = coherent * light_below + full * (1 - below) + (mean - coherent);
      pixels->laser_slope.At(i, j) = light_below;
      pixels->other_slope.At(i, j) = below;
      coherent *= light_below;
      pixels->diffracted.At(i, j) *= light_below;
    }
  }
}

}  // namespace sightline
