// SPDX-License-Identifier: Apache-2.0
// Selects a few of many recordings for a quick first answer.
#pragma once

#include <vector>

#include "sightline/v1/recording.pb.h"

namespace sightline {

// Ascending indices of at most 16 recordings for a quick diagnosis: 12 with the laser on, evenly
// from the whole list and from at least four plate positions if there are as many; 2 dark ones; 2
// with other light only. Of a burst only the first frame is used. For parts, whose expected images
// take most of the time, the numbers are 3, 1 and 1.
std::vector<int> QuickChoice(const v1::Recordings& recordings);

}  // namespace sightline
