// SPDX-License-Identifier: Apache-2.0
// An optical plan as it might come back: made up, but with every field filled.
#pragma once

#include "sightline/v1/catalogue.pb.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

// Nine f-numbers with 24 exposure times each, the best is f/2.8 and f/4 as good; two scans.
v1::OpticsPlan SampleOptics();

// Three combinations, the chosen one in the middle.
v1::DeviceChoice SampleDevices();

}  // namespace sightline
