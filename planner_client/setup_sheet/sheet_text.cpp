// SPDX-License-Identifier: Apache-2.0
#include "planner_client/setup_sheet/sheet_text.h"

#include <cmath>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "report/page/number_text.h"

namespace sightline {

std::string SheetMm(double length_m, int decimals) { return FixedNumber(1e3 * length_m, decimals); }

std::string StageMm(double length_m) {
  std::string text = SheetMm(length_m, 3);
  while (text.back() == '0') text.pop_back();
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string SheetDeg(double angle_deg, int decimals) {
  return absl::StrCat(FixedNumber(angle_deg, decimals), "\u00b0");
}

std::string TurnDeg(double angle_deg, int decimals) {
  return SheetDeg(std::remainder(angle_deg, 360), decimals);
}

std::string PlaceMm(const Eigen::Vector3d& place_m) {
  return absl::StrCat(SheetMm(place_m.x()), " / ", SheetMm(place_m.y()), " / ",
                      SheetMm(place_m.z()));
}

std::string UnitVectorText(const Eigen::Vector3d& v) {
  return absl::StrCat(FixedNumber(v.x(), 4), " / ", FixedNumber(v.y(), 4), " / ",
                      FixedNumber(v.z(), 4));
}

std::string SheetSeconds(double seconds) {
  if (seconds < 120) return absl::StrCat(FixedNumber(seconds, 1), " s");
  const auto whole = static_cast<int64_t>(std::llround(seconds));
  return absl::StrFormat("%d min %02d s", whole / 60, whole % 60);
}

}  // namespace sightline
