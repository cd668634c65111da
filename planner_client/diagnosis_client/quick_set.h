// SPDX-License-Identifier: Apache-2.0
// A few of many recordings, for a first answer.
#pragma once

#include <vector>

#include "sightline/v1/recording.pb.h"

namespace sightline {

// Indices, increasing, of at most 16 recordings that a quick diagnosis is made from: 12 with the
// laser on, evenly from the whole list (of bursts only the first frame, since others follow from
// it), of at least four plate positions where there are as many; 2 dark ones and 2 with other light
// only. Of parts, whose expected images take most of the time, 3, 1 and 1.
std::vector<int> QuickChoice(const v1::Recordings& recordings);

}  // namespace sightline
