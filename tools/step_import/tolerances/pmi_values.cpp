// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/tolerances/pmi_values.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <cstdio>
#include <initializer_list>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "tools/step_import/tolerances/part21.h"

namespace sightline::step_pmi {

bool IsOneOf(std::string_view type, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), type) != names.end();
}

bool IsGeometricTolerance(std::string_view type) {
  if (type == "GEOMETRIC_TOLERANCE" || type == "MODIFIED_GEOMETRIC_TOLERANCE" ||
      type.starts_with("GEOMETRIC_TOLERANCE_WITH_") ||
      type == "UNEQUALLY_DISPOSED_GEOMETRIC_TOLERANCE") {
    return true;
  }
  // Kinds that are unknown here count too, so that they are listed.
  return type.ends_with("_TOLERANCE") && type != "PLUS_MINUS_TOLERANCE";
}

bool IsSize(std::string_view type) {
  return type.starts_with("DIMENSIONAL_SIZE") || type == "ANGULAR_SIZE";
}

bool IsLocation(std::string_view type) {
  return type.starts_with("DIMENSIONAL_LOCATION") || type == "ANGULAR_LOCATION" ||
         type == "DIRECTED_DIMENSIONAL_LOCATION";
}

bool IsDatumTarget(std::string_view type) {
  return type == "DATUM_TARGET" || type == "PLACED_DATUM_TARGET_FEATURE";
}

std::string Lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) {
    c = c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return out;
}

std::string Label(int64_t id) { return "#" + std::to_string(id); }

std::string Millimetres(double metres) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.6g", metres * 1e3);
  return text.data();
}

std::string Degrees(double radians) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.6g", radians * 180 / std::numbers::pi);
  return text.data();
}

const Part21Value& At(const Values& values, size_t i, const char* what) {
  if (i >= values.size()) throw Unreadable{std::string("it has no ") + what};
  return values[i];
}

std::string TextAt(const Values& values, size_t i) {
  return i < values.size() && values[i].kind == Kind::kText ? values[i].text : std::string();
}

int64_t ReferenceAt(const Values& values, size_t i, const char* what) {
  const Part21Value& value = At(values, i, what);
  if (value.kind != Kind::kReference)
    throw Unreadable{std::string("its ") + what + " is not given"};
  return value.reference;
}

void CollectReferences(const Part21Value& value, std::vector<int64_t>& out) {
  if (value.kind == Kind::kReference) out.push_back(value.reference);
  for (const Part21Value& inner : value.list) CollectReferences(inner, out);
}

}  // namespace sightline::step_pmi
