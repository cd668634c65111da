// SPDX-License-Identifier: Apache-2.0
// What single recordings have drawn (light, movement), besides what all have in common.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/effects/described_effect.h"

namespace sightline {

// Of every recording of a set.
struct Realisation {
  std::vector<double> light_relative;  // amount of laser light minus 1
  std::vector<double> shift_px;        // of the image across the line
  std::vector<double> blur_px2;        // variance of its movement about that place
  // Of equal blocks along the line: light over the recording's, minus 1. Empty: all alike.
  struct Blocks {
    int first_column_px = 0, columns_px = 0;
    std::vector<double> light_relative;
  };
  std::vector<Blocks> blocks;

  explicit Realisation(size_t recordings)
      : light_relative(recordings, 0), shift_px(recordings, 0), blur_px2(recordings, 0) {}
};

// Gives every recording of a set its realisation.
class RealisedEffect final : public DescribedEffect {
 public:
  explicit RealisedEffect(Realisation realisation);
  void OnFrame(FrameSetup& frame, Parameters) const override;
  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters) const override;
  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup& frame,
                         Parameters) const override;

 private:
  Realisation realisation_;
};

// Of the line in every recording with laser light, from where `parameters` expect it and over the
// width that they expect.
Realisation LineMovements(const SetModel& model, const SetParameters& parameters);

// Laser light in every recording over what `parameters` expect, wherever the line is, minus 1; 0
// for the median recording, since the known parameters hold what all have in common.
std::vector<double> LightExcesses(const SetModel& model, SetParameters parameters);

// Of a plate position that the set has, among SetModel::position_ids.
Eigen::Index PositionIndex(const SetModel& model, int plate_position_id);
// Block along the line that every entry is about, from the first column on; -1: all of them.
std::vector<int> BlocksOfEntries(const SetModel& model);

// Of the blocks of the line at every plate position, in this order (SetModel::position_ids), the
// reflectance relative to what is expected, minus 1; no less than -0.9, since light has a bound.
// What follows these in the vector is left out.
Realisation RealisedReflectance(const SetModel& model, const Eigen::VectorXd& reflectance);
// The reflectance that the light in blocks shows over what `parameters` expect; 0 for the median.
Eigen::VectorXd ReflectanceExcesses(const SetModel& model, SetParameters parameters);

// The displacements from where the line is on average at its plate position, which the known
// parameters hold; 0 where that is near enough for what is linear.
std::vector<double> DisplacementsAtPositions(const SetModel& model,
                                             const SetParameters& parameters);

}  // namespace sightline
