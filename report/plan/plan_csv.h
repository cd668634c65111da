// SPDX-License-Identifier: Apache-2.0
// A plan as a table for spreadsheets and stage controllers.
#pragma once

#include <string>

#include "sightline/v1/plan.pb.h"

namespace sightline {

// One header row, then one row per scan in plan order; RFC 4180 with LF line ends. Every column's
// name ends in its unit. Numbers are the shortest decimals that read back as the same doubles.
std::string PlanCsv(const v1::Plan& plan);

}  // namespace sightline
