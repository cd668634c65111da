// SPDX-License-Identifier: Apache-2.0
// How the set-up sheet words lengths, angles and times.
#pragma once

#include <Eigen/Core>
#include <string>

namespace sightline {

// Without the unit.
std::string SheetMm(double length_m, int decimals = 1);

// Stage positions are multiples of the scan step: as many decimals as they need, at most three.
std::string StageMm(double length_m);

std::string SheetDeg(double angle_deg, int decimals = 1);

// The shorter way round, from -180 to 180 degrees: everywhere on the sheet, so that one turn has
// one number.
std::string TurnDeg(double angle_deg, int decimals = 1);

// "1.0 / 2.0 / 3.0", in millimetres.
std::string PlaceMm(const Eigen::Vector3d& place_m);

// Four decimals of each component.
std::string UnitVectorText(const Eigen::Vector3d& v);

// "3.2 s", "14 min 02 s".
std::string SheetSeconds(double seconds);

}  // namespace sightline
