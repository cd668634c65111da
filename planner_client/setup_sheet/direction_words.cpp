// SPDX-License-Identifier: Apache-2.0
#include "planner_client/setup_sheet/direction_words.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/physics/angle.h"

namespace sightline {
namespace {

constexpr double kOnAxis_deg = 0.5;

std::string WholeDegrees(double angle_deg) { return absl::StrFormat("%.0f\u00b0", angle_deg); }

double PolarDeg(const Eigen::Vector3d& direction) {
  return std::atan2(std::hypot(direction.x(), direction.y()), direction.z()) * kDegPerRad;
}

// "towards +y", "25\u00b0 from +x towards +y": from the nearer axis, counted to the other one.
std::string Horizontally(const Eigen::Vector3d& direction) {
  const bool nearer_x = std::abs(direction.x()) >= std::abs(direction.y());
  const std::string x = direction.x() >= 0 ? "+x" : "\u2212x";
  const std::string y = direction.y() >= 0 ? "+y" : "\u2212y";
  const double away_deg = std::atan2(nearer_x ? std::abs(direction.y()) : std::abs(direction.x()),
                                     nearer_x ? std::abs(direction.x()) : std::abs(direction.y())) *
                          kDegPerRad;
  if (away_deg < kOnAxis_deg) return absl::StrCat("towards ", nearer_x ? x : y);
  return absl::StrCat(WholeDegrees(away_deg), " from ", nearer_x ? x : y, " towards ",
                      nearer_x ? y : x);
}

}  // namespace

std::string PlaceInWords(const Eigen::Vector3d& place) {
  const double polar_deg = PolarDeg(place);
  if (polar_deg < kOnAxis_deg) return "straight above";
  if (polar_deg > 180 - kOnAxis_deg) return "straight below";
  if (std::abs(polar_deg - 90) < kOnAxis_deg) {
    return absl::StrCat("level, ", Horizontally(place));
  }
  if (polar_deg > 90) {
    return absl::StrCat(WholeDegrees(polar_deg - 90), " below the horizontal, ",
                        Horizontally(place));
  }
  return absl::StrCat(WholeDegrees(polar_deg), " from vertical, ", Horizontally(place));
}

std::string PointsInWords(const Eigen::Vector3d& direction) {
  const double polar_deg = PolarDeg(direction);
  if (polar_deg < kOnAxis_deg) return "up";
  if (polar_deg > 180 - kOnAxis_deg) return "down";
  if (std::abs(polar_deg - 90) < kOnAxis_deg) return Horizontally(direction);
  return absl::StrCat(WholeDegrees(std::abs(90 - polar_deg)), polar_deg < 90 ? " above" : " below",
                      " the horizontal, ", Horizontally(direction));
}

}  // namespace sightline
