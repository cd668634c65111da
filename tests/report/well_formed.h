// SPDX-License-Identifier: Apache-2.0
// Properties of every page, and functions by which tests look into one.
#pragma once

#include <google/protobuf/message.h>

#include <array>
#include <cstddef>
#include <limits>
#include <string>

namespace sightline {

// Empty if all elements of the page are closed in order, attributes are quoted and hold
// neither "nan" nor "inf", ampersands begin entities and ids are unique; otherwise what is wrong.
std::string MarkupFault(const std::string& html);

// Empty if the page loads nothing and runs nothing; otherwise the text that would.
std::string OutsideReference(const std::string& html);

// How often `part` stands in `text`; places may overlap.
size_t CountOf(const std::string& text, const std::string& part);

// The section with this id, up to its end; empty if there is none.
std::string SectionOf(const std::string& html, const std::string& id);

// Numbers that a broken answer might hold, and that no page may show as they are.
inline constexpr std::array<double, 5> kOddNumbers = {std::numeric_limits<double>::quiet_NaN(),
                                                      std::numeric_limits<double>::infinity(), 0.0,
                                                      -1.0, 1e300};

// Sets every text anywhere in the message; every floating-point number.
void SetAllTexts(google::protobuf::Message* message, const std::string& text);
void SetAllNumbers(google::protobuf::Message* message, double value);

}  // namespace sightline
