// SPDX-License-Identifier: Apache-2.0
// Start values of other light that flickers, from a periodogram over the recordings' timestamps.
// Recordings minutes apart distinguish hundreds of thousands of frequencies, and a fit cannot move
// from one to another.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/effects/effect.h"

namespace sightline {

// The few frequencies at which mean and modulation of the other light in the laser recordings gain
// most, by generalised least squares at each frequency (Zechmeister and Kuerster, Astron.
// Astrophys. 496 (2009) 577, with given phase). `effect` has StartSearch::kPeriodogramOfTime; its
// parameters are mean radiance, modulation in [0, 1] and frequency [Hz]. `null`: a fit of `model`
// without effects. `change`: whitened change by steady ambient light of `radiance_w_m2_sr`. Empty:
// there is no such light, or the search would take too long (many recordings over many hours).
std::vector<ActiveEffect> FlickerSeen(const Effect& effect, const SetModel& model,
                                      const FitResult& null, const Eigen::VectorXd& change,
                                      double radiance_w_m2_sr);

}  // namespace sightline
