// SPDX-License-Identifier: Apache-2.0
// Raw images made visible.
#pragma once

#include <string>

namespace sightline {

// The recording at `folder`/`file` (16-bit greyscale PNG) as an 8-bit PNG of at most 640 columns,
// scaled so that its dark level is black and its brightest parts are white; square root of the
// signal, so that faint light shows. Empty if there is no such PNG, it is no plain image, or `file`
// leads out of the folder: a report is complete without it.
std::string RawPicturePng(const std::string& folder, const std::string& file);

}  // namespace sightline
