// SPDX-License-Identifier: Apache-2.0
// The report of an optical plan (thesis, chapter 6.4).
#pragma once

#include <string>

#include "absl/status/status.h"
#include "sightline/v1/catalogue.pb.h"
#include "sightline/v1/optics.pb.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

// Parts that the plan does not contain have no section; the same data give the same report.
// `devices`: combinations of the catalogue that the plan was chosen from; null without a catalogue.
v1::Report OpticsReport(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices);

// The page and its data beside it (WriteReport). Error: a file cannot be written.
absl::Status WriteOpticsReport(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices,
                               const std::string& path);

}  // namespace sightline
