// SPDX-License-Identifier: Apache-2.0
// Shows raw images of recordings.
#pragma once

#include <string>

namespace sightline {

// The recording at `folder`/`file` (16-bit greyscale PNG) as an 8-bit PNG of at most 640 columns.
// Its dark level is black and its brightest parts are white; a square root makes faint light
// visible. Empty if there is no such PNG, if it is not a plain image, or if `file` leads out of the
// folder, since a report is complete without it.
std::string RawPicturePng(const std::string& folder, const std::string& file);

}  // namespace sightline
