// SPDX-License-Identifier: Apache-2.0
// A recording's setup in words.
#pragma once

#include <string>

#include "sightline/v1/recording.pb.h"

namespace sightline {

// "f/8, 5.1 ms, camera 366 mm, focus 300 mm": what is set, as far as it is stated. Dark frames:
// "dark, 20 ms". Text, not escaped.
std::string RecordingSetup(const v1::Recording& recording);

// "Recording 17 (aperture)"; without a description of it: "Recording 17".
std::string RecordingTitle(int index, const v1::Recording* recording);

}  // namespace sightline
