// SPDX-License-Identifier: Apache-2.0
#include "report/sensor/sensor_view.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/match.h"
#include "absl/strings/str_replace.h"

namespace sightline {

SensorView::SensorView(const v1::SensorDiagnosis& of) : diagnosis(of) {
  for (const v1::SensorDeparture& departure : diagnosis.departures()) {
    (departure.found()      ? found
     : departure.testable() ? absent
                            : not_testable)
        .push_back(&departure);
  }
  for (const v1::PhotonTransferPoint& point : diagnosis.photon_transfer()) {
    (point.saturated() ? saturated : points).push_back(&point);
  }
  // Lines go from left to right. A signal that is not finite has no position.
  std::erase_if(points, [](const auto* point) { return !std::isfinite(point->mean_dn()); });
  std::stable_sort(points.begin(), points.end(),
                   [](const auto* a, const auto* b) { return a->mean_dn() < b->mean_dn(); });
  has_model = !found.empty();
}

SensorUnit SensorUnitOf(const std::string& name, const std::string& unit) {
  const bool part = absl::EndsWith(name, "_relative") || absl::EndsWith(name, "_fraction");
  if (unit.empty() || unit == "1") return part ? SensorUnit{100, "%"} : SensorUnit{};
  return {1, absl::StrReplaceAll(unit, {{"e-", "e\u207b"},
                                        {"^2", "\u00b2"},
                                        {"^3", "\u00b3"},
                                        {"^-1", "\u207b\u00b9"},
                                        {"DN2", "DN\u00b2"}})};
}

}  // namespace sightline
