// SPDX-License-Identifier: Apache-2.0
// Text of lengths, angles and times on the set-up sheet.
#pragma once

#include <Eigen/Core>
#include <string>

namespace sightline {

// Length in millimetres, without the unit.
std::string SheetMm(double length_m, int decimals = 1);

// Stage positions are multiples of the scan step: prints the decimals that they need, at most
// three.
std::string StageMm(double length_m);

std::string SheetDeg(double angle_deg, int decimals = 1);

// The angle in [-180, 180] degrees, so that a turn has the same number everywhere on the
// sheet.
std::string TurnDeg(double angle_deg, int decimals = 1);

// "1.0 / 2.0 / 3.0", in millimetres.
std::string PlaceMm(const Eigen::Vector3d& place_m);

// The vector with four decimals of each component.
std::string UnitVectorText(const Eigen::Vector3d& v);

// "3.2 s", "14 min 02 s".
std::string SheetSeconds(double seconds);

}  // namespace sightline
