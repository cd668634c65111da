// SPDX-License-Identifier: Apache-2.0
// Optical settings and what they achieve, in words.
#pragma once

#include <limits>
#include <string>

#include "sightline/v1/optics.pb.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

// Stands for a number that is not known. Texts show it as a dash, charts leave it out.
inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

// All of it, also of points that state the main three only.
v1::OpticalSetting SettingOf(const v1::OpticsPoint& point);

// "f/2.8": text, not escaped.
std::string FNumberText(double f_number);

// "f/2.8, 9 ms, focus 600 mm, laser 5 mW": what is set, as far as it is stated. Text, not escaped.
std::string SettingWords(const v1::OpticsPoint& point);

// "sensor tilted by 2.1° about its rows", and about its columns; empty: it is not tilted.
std::string TiltWords(const v1::OpticalSetting& setting);

// "97.3 %": a share from 0 to 1. Only 0 and 1 themselves are "0 %" and "100 %".
std::string ShareText(double share);

// The same as a cell, its number in per cent.
v1::ReportCell ShareOfLineCell(double share);

// u_px and the real one; NaN where no point was detected, or where it is not known.
double UPx(const v1::OpticsPoint& point);
double ExpectedRealUPx(const v1::OpticsPoint& point);

}  // namespace sightline
