// SPDX-License-Identifier: Apache-2.0
// A frame and the arguments of all hooks, filled with random data.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "render_worker/effects/effect.h"

namespace sightline {

FrameSetup TestFrame();
OpticsModel TestOptics(const FrameSetup& frame);
PlateScene TestScene(const FrameSetup& frame);
Image<double> RandomElectrons(const FrameSetup& frame, uint64_t seed, double largest);
PixelIrradiance RandomLight(const FrameSetup& frame, uint64_t seed);

// Parameters of the effect, null where not given.
std::vector<double> WithParameters(const Effect& effect,
                                   const std::vector<std::pair<std::string, double>>& values);
const Effect& TheEffect(const std::string& id);

// Value of a transfer function list at a frequency.
std::complex<double> Transfer(const OpticsModel& optics, double qx, double qy);

double Sum(const Image<double>& image);

}  // namespace sightline
