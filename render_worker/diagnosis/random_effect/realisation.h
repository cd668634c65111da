// SPDX-License-Identifier: Apache-2.0
// Realised values of random effects: how light, place and blur of every recording differ from what
// all recordings have in common.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/effects/described_effect.h"

namespace sightline {

// One value per recording of a set; null values change nothing.
struct Realisation {
  std::vector<double> light_relative;  // amount of laser light minus 1
  std::vector<double> shift_px;        // displacement of the image across the line
  std::vector<double> blur_px2;        // variance of the image's movement about that place
  // Light of equal segments along the line over the recording's, minus 1. Empty: all alike.
  struct Blocks {
    int first_column_px = 0, columns_px = 0;  // of all segments together
    std::vector<double> light_relative;
  };
  std::vector<Blocks> blocks;

  explicit Realisation(size_t recordings)
      : light_relative(recordings, 0), shift_px(recordings, 0), blur_px2(recordings, 0) {}
};

// Applies a realisation to every recording of a set, by its index.
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

// Displacement and broadening of the line in every recording with laser light, relative to its
// place and width expected for `parameters`.
Realisation LineMovements(const SetModel& model, const SetParameters& parameters);

// Laser light in every recording over the light expected for `parameters`, wherever the line is,
// minus 1. The median recording has 0: the nuisance parameters contain what all have in common.
std::vector<double> LightExcesses(const SetModel& model, SetParameters parameters);

// Index of a plate position of the set in SetModel::position_ids.
Eigen::Index PositionIndex(const SetModel& model, int plate_position_id);
// Segment of the line that every observation block shows, from the first column on; -1: all of
// them.
std::vector<int> BlocksOfEntries(const SetModel& model);

// `reflectance`: of the segments of the line at every plate position, in the order of
// SetModel::position_ids, relative to the expected one, minus 1. Values below -0.9 count as -0.9,
// since light is not negative. Further components of the vector are ignored.
Realisation RealisedReflectance(const SetModel& model, const Eigen::VectorXd& reflectance);
// Reflectance of the same segments from their light over the light expected for `parameters`,
// minus 1. The median segment has 0.
Eigen::VectorXd ReflectanceExcesses(const SetModel& model, SetParameters parameters);

// Displacement of the line in every recording [px] from its mean place at the same plate position,
// which the nuisance parameters contain. It is 0 at positions where all recordings are within
// 0.3 px, near enough for a linear model.
std::vector<double> DisplacementsAtPositions(const SetModel& model,
                                             const SetParameters& parameters);

}  // namespace sightline
