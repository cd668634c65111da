// SPDX-License-Identifier: Apache-2.0
// Text of a recording's set-up.
#pragma once

#include <string>

#include "sightline/v1/recording.pb.h"

namespace sightline {

// "f/8, 5.1 ms, camera 366 mm, focus 300 mm": the stated values. Dark frames: "dark, 20 ms". Text,
// not escaped.
std::string RecordingSetup(const v1::Recording& recording);

// "Recording 17 (aperture)", or "Recording 17" if it has no description.
std::string RecordingTitle(int index, const v1::Recording* recording);

}  // namespace sightline
