// SPDX-License-Identifier: Apache-2.0
// Files of a report: its data, and a page that shows them.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

// The page as UTF-8 HTML: the viewer of viewer/document and the report as JSON. It loads nothing,
// and the same report gives the same bytes. Readers without scripts are sent to `data_file`.
std::string ReportPage(const v1::Report& report, const std::string& data_file);

// Path of the data beside a page: report.json for report.html, optics_report.json for optics.html.
std::string ReportDataPath(const std::string& page_path);

// Writes both, the data first. Each file appears at once or not at all. Errors as of
// WriteFileAtomically.
absl::Status WriteReport(const v1::Report& report, const std::string& page_path);

}  // namespace sightline
