// SPDX-License-Identifier: Apache-2.0
// Lengths and angles with their units.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/pmi_reader.h"
#include "tools/step_import/tolerances/pmi_values.h"

namespace sightline::step_pmi {

PmiReader::Unit PmiReader::UnitOf(int64_t id, int depth) const {
  if (depth > kMaxUnitDepth) throw Unreadable{"its unit refers to itself"};
  const std::vector<Part21Record> records = Records(id);
  if (const Values* conversion = Partial(records, "CONVERSION_BASED_UNIT")) {
    const int64_t factor = ReferenceAt(*conversion, records.size() == 1 ? 2 : 1, "factor");
    const Measure measure = MeasureOf(factor, depth + 1);
    return {measure.value, measure.angle};
  }
  const Values* si = Partial(records, "SI_UNIT");
  if (si == nullptr || si->size() < 2) throw Unreadable{"its unit " + Label(id) + " is unknown"};
  const Part21Value& prefix = (*si)[si->size() - 2];
  const std::string& name = si->back().text;
  Unit unit;
  if (prefix.kind == Kind::kEnum) {
    constexpr std::array<std::pair<std::string_view, double>, 10> kPrefixes = {{{"KILO", 1e3},
                                                                                {"HECTO", 1e2},
                                                                                {"DECA", 1e1},
                                                                                {"DECI", 1e-1},
                                                                                {"CENTI", 1e-2},
                                                                                {"MILLI", 1e-3},
                                                                                {"MICRO", 1e-6},
                                                                                {"NANO", 1e-9},
                                                                                {"PICO", 1e-12},
                                                                                {"MEGA", 1e6}}};
    const auto found = std::ranges::find(kPrefixes, std::string_view(prefix.text),
                                         [](const auto& entry) { return entry.first; });
    if (found == kPrefixes.end()) throw Unreadable{"its unit has prefix " + prefix.text};
    unit.to_si = found->second;
  }
  if (name == "RADIAN") {
    unit.angle = true;
  } else if (name != "METRE") {
    throw Unreadable{"its unit is " + Lower(name) + ", neither a length nor an angle"};
  }
  return unit;
}

Measure PmiReader::MeasureOf(int64_t id, int depth) const {
  const std::vector<Part21Record> records = Records(id);
  const Values* values = Partial(records, "MEASURE_WITH_UNIT");
  if (values == nullptr) values = &records[0].values;
  Measure measure;
  for (const Part21Record& record : records) {
    // Its name stands in a record of its own or comes first.
    if ((record.type == "REPRESENTATION_ITEM" || records.size() == 1) &&
        !TextAt(record.values, 0).empty()) {
      measure.name = Lower(TextAt(record.values, 0));
    }
  }
  std::optional<double> number;
  std::optional<int64_t> unit;
  for (const Part21Value& value : *values) {
    const bool typed =
        value.kind == Kind::kTyped && value.list.size() == 1 && value.list[0].kind == Kind::kNumber;
    if (!number && typed) number = value.list[0].number;
    if (!number && value.kind == Kind::kNumber) number = value.number;
    if (!unit && value.kind == Kind::kReference) unit = value.reference;
  }
  if (!number) throw Unreadable{"its value " + Label(id) + " is no number"};
  if (!unit) throw Unreadable{"its value " + Label(id) + " has no unit"};
  const Unit of = UnitOf(*unit, depth);
  measure.value = *number * of.to_si;
  measure.angle = of.angle;
  if (!std::isfinite(measure.value)) throw Unreadable{"its value is not finite"};
  return measure;
}

double PmiReader::LengthOf(int64_t id) const {
  const Measure measure = MeasureOf(id);
  if (measure.angle) throw Unreadable{"its value is an angle where a length is meant"};
  return measure.value;
}

}  // namespace sightline::step_pmi
