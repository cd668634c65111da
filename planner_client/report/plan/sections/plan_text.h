// SPDX-License-Identifier: Apache-2.0
// How the report of a plan words numbers and builds its sections.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/string_view.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

std::string Percent(double fraction, int decimals = 1);

// As it was stated: "95 %", "97.5 %".
std::string GoalText(double fraction);

// Without the unit.
std::string Millimetres(double length_m, int decimals = 1);

// "3.21 s", "14 min 02 s".
std::string SecondsText(double seconds);

// "1 scan", "17 scans".
std::string CountText(int64_t count, absl::string_view noun);

// `body` is HTML.
std::string PlanSection(absl::string_view id, absl::string_view title, absl::string_view body,
                        absl::string_view css_class = "");

// Two columns: what it is, its value. Values are HTML.
std::string FactsTable(const std::vector<std::pair<std::string, std::string>>& facts,
                       absl::string_view value_class = "");

// Nothing without a picture.
std::string PictureFigure(const std::string& png, absl::string_view caption);

// Why the search ended: "the goal was reached".
std::string StopWords(v1::Plan::StopReason reason);

bool GoalReached(const v1::PlanCoverage& coverage);

}  // namespace sightline
