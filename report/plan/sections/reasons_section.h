// SPDX-License-Identifier: Apache-2.0
// Section on the reasons why parts of the surface are not measured.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "report/document/report_parts.h"
#include "report/plan/sections/report_data.h"

namespace sightline {

// Tables of reasons: of all targets, of every region of interest and of every toleranced feature.
// Empty if no reasons are known or all targets are covered.
ReportBlocks ReasonsBlocks(const ReportData& data);

// "hidden by the part itself (12), not chosen (3)" for given targets; empty without reasons.
std::string ReasonsOf(const ReportData& data, const std::vector<uint32_t>& targets);

// Reasons of the targets that count as not measurable.
std::string ReasonsOfUnmeasurable(const ReportData& data);

}  // namespace sightline
