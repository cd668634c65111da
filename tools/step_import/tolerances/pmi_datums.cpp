// SPDX-License-Identifier: Apache-2.0
// Datums, their targets, and systems of them.
#include <algorithm>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/tolerance/tolerance.h"
#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/pmi_reader.h"
#include "tools/step_import/tolerances/pmi_values.h"
#include "tools/step_import/tolerances/step_pmi.h"

namespace sightline::step_pmi {

void PmiReader::ReadDatums() {
  std::set<int64_t> established;  // features of datums
  for (const int64_t id : file_.Find([](std::string_view t) { return t == "DATUM"; })) {
    ReadOne(id, [&] {
      Datum datum;
      datum.id = Label(id);
      datum.letter = DatumLetter(id);
      // Some programs identify the datum itself with the faces.
      std::vector<int64_t> aspects = {id};
      const auto [first, last] = wholes_.equal_range(id);
      for (auto it = first; it != last; ++it) {
        established.insert(it->second);
        if (std::ranges::any_of(file_.Types(it->second), IsDatumTarget)) continue;
        aspects.push_back(it->second);
      }
      PmiBinding binding = Resolve(aspects);
      pmi_.report.datums.push_back(std::move(datum));
      pmi_.datums.push_back(std::move(binding));
    });
  }
  for (const int64_t id : file_.Find(IsDatumTarget)) {
    ReadOne(id, [&] {
      const std::vector<Part21Record> records = Records(id);
      const Values* base = Partial(records, "DATUM_TARGET");
      std::string number =
          base != nullptr && records.size() > 1 ? TextAt(*base, 0) : TextAt(records[0].values, 4);
      std::string letter;
      const auto [first, last] = parts_.equal_range(id);
      for (auto it = first; it != last; ++it) {
        if (file_.IsA(it->second, "DATUM")) letter = DatumLetter(it->second);
      }
      Datum datum;
      datum.id = Label(id);
      datum.letter = letter + number;
      datum.target = true;
      PmiBinding binding = Resolve({id});
      // The feature on which it lies refers to it.
      const auto [from, to] = wholes_.equal_range(id);
      for (auto it = from; it != to; ++it) AddItems(it->second, binding.items);
      EachOnce(binding.items);
      pmi_.report.datums.push_back(std::move(datum));
      pmi_.datums.push_back(std::move(binding));
    });
  }
  for (const int64_t id : file_.Find([](std::string_view t) { return t == "DATUM_FEATURE"; })) {
    if (established.contains(id)) continue;
    const auto [first, last] = parts_.equal_range(id);
    const bool leads_to_datum =
        std::any_of(first, last, [&](const auto& part) { return file_.IsA(part.second, "DATUM"); });
    if (!leads_to_datum) Unread(id, "", "a datum feature that no datum refers to");
  }
}

std::string PmiReader::DatumLetter(int64_t id) const {
  const std::vector<Part21Record> records = Records(id);
  std::string letter =
      records.size() == 1 ? TextAt(records[0].values, 4) : TextAt(Base(records, "DATUM"), 0);
  if (letter.empty()) throw Unreadable{"the datum " + Label(id) + " has no letter"};
  return letter;
}

std::string PmiReader::DatumText(const Part21Value& value, int depth) const {
  if (depth > kMaxUnitDepth) throw Unreadable{"its datum system refers to itself"};
  if (value.kind == Kind::kList || value.kind == Kind::kTyped) {
    std::string text;
    for (const Part21Value& inner : value.list) {
      const std::string part = DatumText(inner, depth + 1);
      text += (text.empty() || part.empty() ? "" : "-") + part;
    }
    return text;
  }
  if (value.kind != Kind::kReference) return {};
  const int64_t id = value.reference;
  if (file_.IsA(id, "DATUM")) return DatumLetter(id);
  const std::vector<Part21Record> records = Records(id);
  const std::string& type = records[0].type;
  if (records.size() == 1 &&
      IsOneOf(type, {"DATUM_REFERENCE_COMPARTMENT", "DATUM_REFERENCE_ELEMENT"})) {
    const Values& values = records[0].values;
    return DatumText(At(values, 4, "datum"), depth + 1) +
           (values.size() > 5 ? DatumModifiers(values[5]) : "");
  }
  if (const Values* general = Partial(records, "GENERAL_DATUM_REFERENCE")) {
    return DatumText(At(*general, 0, "datum"), depth + 1) +
           (general->size() > 1 ? DatumModifiers((*general)[1]) : "");
  }
  if (type == "DATUM_REFERENCE" || type == "REFERENCED_MODIFIED_DATUM") {
    const Values& values = records[0].values;
    return DatumText(At(values, 1, "datum"), depth + 1) +
           (values.size() > 2 ? DatumModifiers(values[2]) : "");
  }
  throw Unreadable{"its datum system has " + Label(id) + " " + TypeText(id) + ", which is unknown"};
}

std::string PmiReader::DatumModifiers(const Part21Value& value) const {
  std::string text;
  if (value.kind == Kind::kEnum) {
    if (value.text.starts_with("MAXIMUM_MATERIAL")) return "(M)";
    if (value.text.starts_with("LEAST_MATERIAL")) return "(L)";
    if (value.text == "REGARDLESS_OF_FEATURE_SIZE") return "";
    return "[" + Lower(value.text) + "]";
  }
  if (value.kind == Kind::kReference) {
    for (const Part21Record& record : Records(value.reference)) {
      for (const Part21Value& inner : record.values) {
        if (inner.kind == Kind::kEnum) text += DatumModifiers(inner);
        if (inner.kind == Kind::kReference) {
          text += "[" + Millimetres(LengthOf(inner.reference)) + " mm]";
        }
      }
    }
  }
  for (const Part21Value& inner : value.list) text += DatumModifiers(inner);
  return text;
}

std::vector<std::string> PmiReader::DatumSystem(const Part21Value& list) const {
  std::vector<int64_t> references;
  CollectReferences(list, references);
  std::vector<std::pair<double, std::string>> ordered;
  for (const int64_t id : references) {
    if (file_.IsA(id, "DATUM_SYSTEM")) {
      const std::vector<Part21Record> records = Records(id);
      const Values values = Base(records, "DATUM_SYSTEM");
      for (const Part21Value& part : At(values, records.size() == 1 ? 4 : 0, "compartment").list) {
        ordered.emplace_back(0, DatumText(part, 0));
      }
      continue;
    }
    Part21Value value;
    value.kind = Kind::kReference;
    value.reference = id;
    double precedence = 0;
    const std::vector<Part21Record> records = Records(id);
    if (records[0].type == "DATUM_REFERENCE" || records[0].type == "REFERENCED_MODIFIED_DATUM") {
      const Part21Value& first = At(records[0].values, 0, "precedence");
      if (first.kind == Kind::kNumber) precedence = first.number;
    }
    ordered.emplace_back(precedence, DatumText(value, 0));
  }
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> datums;
  for (auto& [precedence, text] : ordered) datums.push_back(std::move(text));
  return datums;
}

}  // namespace sightline::step_pmi
