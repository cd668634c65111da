// SPDX-License-Identifier: Apache-2.0
// Text of optical settings and their results.
#pragma once

#include <limits>
#include <string>

#include "sightline/v1/optics.pb.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

// Placeholder for an unknown number. Texts show it as a dash, charts leave it out.
inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

// The complete setting, also for points that state only the main three values.
v1::OpticalSetting SettingOf(const v1::OpticsPoint& point);

// "f/2.8": text, not escaped.
std::string FNumberText(double f_number);

// "f/2.8, 9 ms, focus 600 mm, laser 5 mW": the stated values. Text, not escaped.
std::string SettingWords(const v1::OpticsPoint& point);

// "sensor tilted by 2.1° about its rows", and likewise for its columns; empty without tilt.
std::string TiltWords(const v1::OpticalSetting& setting);

// "97.3 %" for a fraction from 0 to 1. Only exactly 0 and 1 give "0 %" and "100 %".
std::string ShareText(double share);

// The same as a cell with its number in per cent.
v1::ReportCell ShareOfLineCell(double share);

// u_px, and that of the real camera; NaN if unknown or if no point was detected.
double UPx(const v1::OpticsPoint& point);
double ExpectedRealUPx(const v1::OpticsPoint& point);

}  // namespace sightline
