// SPDX-License-Identifier: Apache-2.0
// The report of an optical plan (thesis, chapter 6.4): one HTML file that needs nothing else, not
// even a network. Charts are drawn without a script, so that they print.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "sightline/v1/catalogue.pb.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

// The page as UTF-8 HTML; the same data give the same bytes. All texts are escaped; what the plan
// does not hold has no section. `devices`: the combinations of the catalogue it was chosen from;
// null: there was no catalogue.
std::string RenderOpticsReport(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices);

// The same into a file, which appears at once or not at all. Error: the file cannot be written.
absl::Status WriteOpticsReport(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices,
                               const std::string& path);

}  // namespace sightline
