// SPDX-License-Identifier: Apache-2.0
// Sensors count exposure times in whole line times T: the true one is T max(1, round(t/T)). The
// error is a saw-tooth of the set exposure. PCO, pco.edge 4.2 bi user manual (exposure time in
// steps of one line time of 12.174 us).
#include <algorithm>
#include <cmath>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class ExposureStepsLaw final : public DescribedEffect {
 public:
  ExposureStepsLaw()
      : DescribedEffect({.id = "outside.exposure_steps",
                         .stage = Stage::kTime,
                         .signature = {{"line_core", "whole_image"}, {"exposure_time_s"}},
                         .summary = "exposure time is a whole number of line times",
                         .reference = "PCO, pco.edge 4.2 bi user manual (exposure time in steps of "
                                      "one line time)",
                         .parameters = {{"line_time_s", 0, 0, 0.01, 2e-5}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    frame.exposure_time_s = p[0] * std::max(1.0, std::round(frame.exposure_time_s / p[0]));
  }
};

}  // namespace

OutsideLaw ExposureSteps() {
  static const ExposureStepsLaw law;
  return {&law, "time", {}};
}

}  // namespace sightline::bench
