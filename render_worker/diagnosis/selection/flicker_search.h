// SPDX-License-Identifier: Apache-2.0
// At which frequency other light flickers in recordings minutes apart: hundreds of thousands of
// them are told apart, and a fit that starts at another one does not find it.
#pragma once

#include <Eigen/Core>
#include <string_view>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/effects/effect.h"

namespace sightline {

inline constexpr std::string_view kAmbientFlicker = "time.ambient_flicker";

// The few frequencies at which a mean with a modulation describes the other light of the laser
// recordings best, with both, as parameters of time.ambient_flicker. `null`: a fit of `model`
// without effects; `change`: whitened, by steady ambient light of this radiance. Empty: there is no
// such light, or the search would take too long (many recordings over many hours).
std::vector<ActiveEffect> FlickerSeen(const SetModel& model, const FitResult& null,
                                      const Eigen::VectorXd& change, double radiance_w_m2_sr);

}  // namespace sightline
