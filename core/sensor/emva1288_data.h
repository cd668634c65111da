// SPDX-License-Identifier: Apache-2.0
// The EMVA 1288 data file: which images of a camera under uniform light, and which in the dark,
// were taken under which conditions. Lines, as the reference data sets of the standard have them:
//
//   v 3.0                 version of the standard
//   n 12 640 480          bits per pixel, columns, rows
//   b 40000.0 120.0       with light: exposure time [ns], photons per pixel
//   d 40000.0             without light: exposure time [ns]
//   i images\b_001.png    an image of the b or d line above it
//   l InterfaceType GigE  text for the test report, which is not read
//   # a comment
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// The data file's usual name in its folder.
inline constexpr char kEmva1288DataFile[] = "EMVA1288_Data.txt";

// The set that the text lists, valid as CheckSensorSet says. Steps with light come first, in the
// order of exposure time, photons and name of the first image, whatever the order of the lines;
// paths have '/' as separator. A b line may lack its photons. Numbers may have a decimal comma.
// INVALID_ARGUMENT names `context` (the file), the line and the reason: an unknown kind of line, a
// number that cannot be read or can be read in two ways ("320,000"), an image before any step, a
// step of fewer than two images, more than 100 000 lines.
absl::StatusOr<v1::SensorSet> ParseEmva1288Data(std::string_view text, const std::string& context);

// Whether the set can be evaluated at all: 1 to 16 bits, size in [8, 65536] pixels, one to 10 000
// steps of two to 10 000 images with names; finite exposure times of at least 0, finite photons of
// at least 0 in all bright steps or in none. INVALID_ARGUMENT names `context`, field and value.
absl::Status CheckSensorSet(const v1::SensorSet& set, const std::string& context);

// Remarks on a valid set: it warns if the photons are the same for every exposure time.
std::vector<std::string> SensorSetRemarks(const v1::SensorSet& set);

}  // namespace sightline
