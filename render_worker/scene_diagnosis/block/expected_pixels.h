// SPDX-License-Identifier: Apache-2.0
// Expected charge of every pixel of one recording for given factors of the light paths.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/image/image.h"
#include "render_worker/scene_diagnosis/block/block_grid.h"
#include "render_worker/scene_diagnosis/light_paths.h"

namespace sightline {

// Light paths in the order of their factors in a parameter vector.
using PathChoice = std::vector<const LightPath*>;

// Images of the grid's size [electrons].
struct ExpectedPixels {
  Image<double> all;         // mean of all light
  Image<double> laser;       // its coherent part, which has speckle
  Image<double> diffracted;  // the part of `laser` that diffraction brought from afar
  // Derivatives of the mean after clipping by the means of laser light and of other light before.
  Image<double> laser_slope, other_slope;
};

// The sum of factor times path, before clipping; slopes are 1.
ExpectedPixels SumOfPaths(const PathChoice& paths, const Eigen::VectorXd& factors, int recording,
                          const BlockGrid& grid);

// Replaces means by those after clipping at `full_electrons`. The laser light of a pixel follows a
// Gamma distribution of shape M = 1/C^2 and mean m (Goodman, Speckle Phenomena in Optics, 2nd ed.,
// section 4.7.2), so that with F = full - other light and P the regularised incomplete gamma
// function
//   E min(x, F) = m P(M + 1, M F/m) + F (1 - P(M, M F/m)).
// `contrast_squared` = C^2 > 0.
void ClipAtFullCharge(double full_electrons, double contrast_squared, ExpectedPixels* pixels);

}  // namespace sightline
