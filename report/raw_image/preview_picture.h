// SPDX-License-Identifier: Apache-2.0
// Makes raw images visible. On a screen raw values of a laser line look dark, since a few bright
// pixels determine the scale.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "report/raw_image/raw_png.h"

namespace sightline {

// 8-bit PNG of the same size, grey or, of an RGGB mosaic, colour (each pixel that of its cell of
// four). Not data: it says so in its text. Per channel, black is the median's side of the darkest
// percent and white the brightest thousandth; values between are raised by gamma 1/2.2. Channels
// share one scale after they have been balanced to equal medians (by at most four), so that
// ambient light is grey and laser light keeps its colour.
absl::StatusOr<std::string> PreviewPng(const RawPng& raw, bool bayer);

}  // namespace sightline
