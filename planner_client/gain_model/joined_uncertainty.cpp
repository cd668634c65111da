// SPDX-License-Identifier: Apache-2.0
#include "planner_client/gain_model/joined_uncertainty.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "core/status/status_macros.h"
#include "planning/requirements/joined_scans.h"

namespace sightline {

absl::StatusOr<PlanKnowledge> JoinScans(const Inspection& inspection,
                                        const Requirements& requirements, CoverageClient& client,
                                        std::span<const Measurement> scans,
                                        std::span<const uint32_t> targets,
                                        PosteriorUncertainties& u) {
  const size_t count = client.targets().size();
  std::vector<uint32_t> asked(targets.begin(), targets.end());
  if (asked.empty()) {
    asked.resize(count);
    std::iota(asked.begin(), asked.end(), 0u);
  }
  PlanKnowledge knowledge;
  knowledge.targets = &client.targets();
  knowledge.measurable = &client.measurable();
  knowledge.points.assign(count, 0);
  knowledge.uncertainty.assign(count, SurfaceUncertainty{});
  for (size_t i = 0; i < asked.size(); ++i) {
    knowledge.points[asked[i]] = u.points[i];
    knowledge.uncertainty[asked[i]] = {u.total_m[i], u.noise_m[i], u.sampling_m[i],
                                       u.calibration_m[i]};
  }
  const bool joins = inspection.uncertainty->registration != RegistrationMethod::kNone;
  if (joins) u.registration_m.assign(asked.size(), 0);
  if (!HasSharedErrors(inspection) || scans.empty()) return knowledge;
  SIGHTLINE_ASSIGN_OR_RETURN(auto information, client.FastInformation(scans));
  for (const InformedScan& scan : information) {
    std::vector<float>& density = knowledge.density.emplace_back(count, 0.0F);
    for (size_t i = 0; i < scan.targets.size(); ++i) density[scan.targets[i]] = scan.density[i];
  }
  knowledge.shared = SharedErrorsOf(inspection, requirements, scans, client.scene().part_centre_m,
                                    knowledge, inspection.uncertainty->registration);
  const size_t steps = u.after_each_scan_m.size() / std::max<size_t>(1, asked.size());
  for (size_t i = 0; i < asked.size(); ++i) {
    SharedErrors::AtTarget shared;
    if (!knowledge.shared.Evaluate(asked[i], &shared)) continue;
    SurfaceUncertainty& joined = knowledge.uncertainty[asked[i]];
    const double before_m = joined.total_m;
    joined.calibration_m = shared.calibration_m;
    joined.registration_m = shared.registration_m;
    joined.total_m = std::hypot(std::hypot(joined.noise_m, joined.sampling_m), joined.calibration_m,
                                joined.registration_m);
    u.total_m[i] = static_cast<float>(joined.total_m);
    u.calibration_m[i] = static_cast<float>(joined.calibration_m);
    if (joins) u.registration_m[i] = static_cast<float>(joined.registration_m);
    const double added_m2 = joined.total_m * joined.total_m - before_m * before_m;
    for (size_t s = 0; s < steps; ++s) {
      float& after_m = u.after_each_scan_m[i * steps + s];
      after_m = static_cast<float>(
          std::sqrt(std::max(0.0, double{after_m} * double{after_m} + added_m2)));
    }
  }
  return knowledge;
}

}  // namespace sightline
