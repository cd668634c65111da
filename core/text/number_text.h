// SPDX-License-Identifier: Apache-2.0
// Numbers as text, for JSON and for messages.
#pragma once

#include <string>

namespace sightline {

// Shortest text that reads back as the same number, without an exponent from 1e-5 to 1e15.
// NaN and infinity: "NaN", "Infinity", "-Infinity".
std::string NumberText(double value);
// The same for single precision: 0.1f is "0.1".
std::string FloatText(float value);

}  // namespace sightline
