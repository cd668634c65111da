// SPDX-License-Identifier: Apache-2.0
#include "planning/plan_file/plan_file.h"

#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"

namespace sightline {

absl::StatusOr<PlanFileScans> ReadPlanScans(const std::string& path, GivenPlans* given) {
  PlanFileScans scans;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(path, &scans.plan));
  if (scans.plan.scans_size() > kMostPlanScans) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": scans has ", scans.plan.scans_size(),
                                                   " entries, at most ", kMostPlanScans,
                                                   " can be evaluated"));
  }
  const MeasurementDomain domain = ThesisDomain();
  for (int i = 0; i < scans.plan.scans_size(); ++i) {
    const v1::PlannedScan& scan = scans.plan.scans(i);
    if (!scan.has_measurement()) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": scans[", i, "].measurement is missing"));
    }
    const Measurement measurement = MeasurementFromProto(scan.measurement());
    const auto values = ToArray(measurement);
    for (int p = 0; p < kMeasurementParameters; ++p) {
      if (domain.parameters[p].Contains(values[p])) continue;
      const bool angle = p >= 1 && p <= 6;
      std::string allowed;
      for (const auto& range : domain.parameters[p].ranges) {
        const double scale = angle ? 180 / std::numbers::pi : 1;
        absl::StrAppend(&allowed, allowed.empty() ? "" : " or ",
                        absl::StrFormat("[%.6g, %.6g]", scale * range.min, scale * range.max));
      }
      return absl::InvalidArgumentError(
          absl::StrFormat("%s: scans[%d].measurement.%s is %.9g, must be in %s", path, i,
                          kMeasurementParameterNames[p],
                          angle ? values[p] * 180 / std::numbers::pi : values[p], allowed));
    }
    scans.all.push_back(measurement);
    scans.locked.push_back(scan.locked());
  }
  given->plans.push_back({path, scans.plan.part_digest()});
  return scans;
}

}  // namespace sightline
