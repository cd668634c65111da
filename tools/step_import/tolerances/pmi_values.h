// SPDX-License-Identifier: Apache-2.0
// Values and kinds of the entities that PMI consists of.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "tools/step_import/tolerances/part21.h"

namespace sightline::step_pmi {

using Kind = Part21Value::Kind;
using Values = std::vector<Part21Value>;

// A reason why an entity is not read.
struct Unreadable {
  std::string reason;
};

struct Measure {
  double value = 0;  // [m] or [rad]
  bool angle = false;
  std::string name;  // of the representation item
};

// Whether an entity type is meant.
bool IsOneOf(std::string_view type, std::initializer_list<std::string_view> names);
bool IsGeometricTolerance(std::string_view type);
bool IsSize(std::string_view type);
bool IsLocation(std::string_view type);
bool IsDatumTarget(std::string_view type);

// "MAXIMUM_MATERIAL" -> "maximum material".
std::string Lower(std::string_view text);
// "#12".
std::string Label(int64_t id);
// Six digits, without the unit.
std::string Millimetres(double metres);
std::string Degrees(double radians);

// Attribute `i`; Unreadable, by the name `what`, if there is none.
const Part21Value& At(const Values& values, size_t i, const char* what);
// Empty if it is no text.
std::string TextAt(const Values& values, size_t i);
// Unreadable if it is no reference.
int64_t ReferenceAt(const Values& values, size_t i, const char* what);

// All references in a value, through lists and typed values.
void CollectReferences(const Part21Value& value, std::vector<int64_t>& out);

// References that follow each other to one unit, datum or aspect: a loop has no end.
inline constexpr int kMaxUnitDepth = 8;

}  // namespace sightline::step_pmi
