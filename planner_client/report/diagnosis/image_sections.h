// SPDX-License-Identifier: Apache-2.0
// Sections on what the recordings show: profiles across the line, and maps over the image.
#pragma once

#include <string>

#include "planner_client/report/diagnosis/diagnosis_view.h"

namespace sightline {

// HTML below the section's heading; empty if the diagnosis holds none.
std::string ProfilesHtml(const DiagnosisView& view);
std::string RegionMapsHtml(const DiagnosisView& view);

}  // namespace sightline
