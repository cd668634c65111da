// SPDX-License-Identifier: Apache-2.0
// Physics outside the vocabulary: laws from literature on cameras, optics, lasers, surfaces and
// motion that are neither an effect of render_worker/effects nor of the form of a discrepancy term.
// A seed that never changes divides them into ten for development and ten that are sealed. The
// sealed ones serve once, after work on the method has ended.
//
// A new law is a file in one of the folders and a line below.
#pragma once

#include <string_view>
#include <vector>

#include "bench/concealed/shape_range.h"
#include "render_worker/effects/effect.h"

namespace sightline::bench {

struct OutsideLaw {
  const Effect* effect = nullptr;  // id "outside.<name>"; its first parameter is the strength
  // The stage at which the law acts: "source", "plate", "geometry", "pupil", "pixel irradiance",
  // "electrons", "readout" or "time".
  std::string_view point;
  std::vector<ShapeRange> shapes = {};
  // The law changes speckle or noise, which not every expected mean shows (ShowsBeyondTheMean).
  bool shows_beyond_the_mean = false;
};

#define SIGHTLINE_OUTSIDE_LAWS(X) \
  X(LensEdgeDiffraction)          \
  X(LineFocusCurvature)           \
  X(CoherenceLength)              \
  X(LineKink)                     \
  X(PlateWaviness)                \
  X(Bleaching)                    \
  X(ObliqueSubsurface)            \
  X(PupilDeposit)                 \
  X(MountTrefoil)                 \
  X(FocusBreathing)               \
  X(ThermalFocusDrift)            \
  X(StitchedBlocks)               \
  X(ColumnSlew)                   \
  X(DualGainStep)                 \
  X(ClampDroop)                   \
  X(SarBitWeight)                 \
  X(CoolerCycle)                  \
  X(GuidewayRoll)                 \
  X(StageSettling)                \
  X(ExposureSteps)

#define SIGHTLINE_DECLARE(name) OutsideLaw name();
SIGHTLINE_OUTSIDE_LAWS(SIGHTLINE_DECLARE)
#undef SIGHTLINE_DECLARE

// All laws, in the order above.
const std::vector<OutsideLaw>& OutsideLaws();
// The half drawn for development, and the sealed half, each in the order above.
std::vector<OutsideLaw> DevelopmentLaws();
std::vector<OutsideLaw> SealedLaws();
// nullptr: no such law.
const OutsideLaw* FindOutsideLaw(std::string_view id);

}  // namespace sightline::bench
