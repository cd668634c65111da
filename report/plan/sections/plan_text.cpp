// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/plan_text.h"

#include <cmath>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "report/page/html.h"
#include "report/page/number_text.h"

namespace sightline {

std::string Percent(double fraction, int decimals) {
  return absl::StrFormat("%.*f\u202f%%", decimals, 100 * fraction);
}

std::string GoalText(double fraction) { return absl::StrFormat("%.6g\u202f%%", 100 * fraction); }

std::string Millimetres(double length_m, int decimals) {
  return FixedNumber(1e3 * length_m, decimals);
}

std::string SecondsText(double seconds) {
  if (seconds >= 120) {
    const auto whole = static_cast<int64_t>(std::llround(seconds));
    return absl::StrFormat("%d min %02d s", whole / 60, whole % 60);
  }
  return absl::StrCat(FixedNumber(seconds, seconds < 10 ? 2 : 1), " s");
}

std::string CountText(int64_t count, absl::string_view noun) {
  return absl::StrCat(GroupedInteger(count), " ", noun, count == 1 ? "" : "s");
}

v1::ReportCell FixedCell(double value, int decimals) {
  return NumberCell(value, std::isfinite(value) ? FixedNumber(value, decimals) : kNoValue);
}

v1::ReportCell MillimetreCell(double length_m, int decimals) {
  return FixedCell(1e3 * length_m, decimals);
}

v1::ReportCell PercentCell(double fraction, int decimals) {
  return NumberCell(100 * fraction,
                    std::isfinite(fraction) ? Percent(fraction, decimals) : kNoValue, "%");
}

v1::ReportFact SecondsFact(const std::string& name, double seconds) {
  return NumberFact(name, seconds, "s", SecondsText(seconds));
}

v1::ReportFact PercentFact(const std::string& name, double fraction, int decimals,
                           const std::string& detail) {
  return NumberFact(name, 100 * fraction, "%",
                    std::isfinite(fraction) ? Percent(fraction, decimals) : kNoValue, detail);
}

void ShowScan(int scan, v1::ReportRow* row) { row->mutable_view()->set_scan(scan); }

void ShowUnmeasuredRegion(int region, v1::ReportRow* row) {
  row->mutable_view()->set_unmeasured_region(region);
}

void ShowFeature(int feature, v1::ReportRow* row) { row->mutable_view()->set_feature(feature); }

std::string StopWords(v1::Plan::StopReason reason) {
  switch (reason) {
    case v1::Plan::STOP_REASON_GOAL_REACHED:
      return "the goal was reached";
    case v1::Plan::STOP_REASON_MAX_SCANS:
      return "the largest number of scans was reached";
    case v1::Plan::STOP_REASON_MAX_TIME:
      return "the time was up";
    case v1::Plan::STOP_REASON_STALLED:
      return "further scans would have added too little, although the rig can measure more";
    case v1::Plan::STOP_REASON_INTERRUPTED:
      return "it was interrupted";
    case v1::Plan::STOP_REASON_EVALUATED:
      return "the plan was given; only its coverage was computed";
    case v1::Plan::STOP_REASON_EXECUTION_LIMIT:
      return "a limit on time to execute, set-ups, sensor places or resting faces was reached";
    default:
      return "not recorded";
  }
}

bool GoalReached(const v1::PlanCoverage& coverage) {
  return coverage.goal() > 0 && coverage.coverage() >= coverage.goal() - 1e-12;
}

}  // namespace sightline
