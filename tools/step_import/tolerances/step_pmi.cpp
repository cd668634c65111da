// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/tolerances/step_pmi.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/tolerance/tolerance.h"
#include "tools/step_import/step_input_error.h"
#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/pmi_reader.h"
#include "tools/step_import/tolerances/pmi_values.h"

namespace sightline::step_pmi {

StepPmi PmiReader::Read() {
  pmi_.report.standard = Standard();
  IndexAspects();
  IndexAnnotations();
  IndexZones();
  IndexDimensions();
  ReadDatums();
  for (const int64_t id : file_.Find(IsGeometricTolerance)) {
    ReadOne(id, [&] { ReadGeometricTolerance(id); });
  }
  for (const int64_t id : file_.Find([](auto t) { return IsSize(t) || IsLocation(t); })) {
    ReadOne(id, [&] { ReadDimension(id); });
  }
  for (const auto& [id, dimension] : stray_ranges_) {
    Unread(id, "", "it belongs to no dimension that is in the file");
  }
  ToleranceReport& report = pmi_.report;
  if (report.entity_count == 0) NoteGraphicAnnotations();
  const auto targets = std::ranges::count_if(report.datums, &Datum::target);
  if (targets > 0) {
    report.notes.push_back(std::to_string(targets) +
                           " datum targets: their places and sizes are not read");
  }
  pmi_.work = work_;
  return std::move(pmi_);
}

void PmiReader::Count(int64_t id, size_t work) const {
  work_ += work;
  if (work_ <= kMostWork) return;
  throw StepInputError(file_.name() + ": " + Label(id) +
                       ": the entities of this file refer to each other so often that its "
                       "tolerances cannot be read");
}

std::vector<Part21Record> PmiReader::Records(int64_t id) const {
  Count(id, kBytesOfLook + file_.Bytes(id));
  try {
    return file_.Records(id);
  } catch (const StepInputError& error) {
    throw Unreadable{error.what()};
  }
}

const Values* PmiReader::Partial(const std::vector<Part21Record>& records, std::string_view type) {
  for (const Part21Record& record : records) {
    if (record.type == type) return &record.values;
  }
  return nullptr;
}

Values PmiReader::Base(const std::vector<Part21Record>& records, std::string_view type) {
  if (records.size() == 1) return records[0].values;
  const Values* values = Partial(records, type);
  if (values == nullptr) throw Unreadable{"it has no record " + std::string(type)};
  return *values;
}

void PmiReader::Unread(int64_t id, const std::string& name, const std::string& reason) {
  ++pmi_.report.entity_count;
  pmi_.report.not_read.push_back({name.empty() ? UnreadName(id) : name, reason});
}

std::string PmiReader::TypeText(int64_t id) const {
  std::string text;
  for (const std::string_view type : file_.Types(id)) {
    if (!text.empty()) text += "+";
    text += type;
  }
  Count(id, text.size());
  return text;
}

std::string PmiReader::UnreadName(int64_t id) const {
  std::string name;
  try {
    name = OwnName(id);
  } catch (const Unreadable&) {
    // Nameless then.
  }
  return (name.empty() ? "" : name + " ") + "(" + Label(id) + " " + TypeText(id) + ")";
}

std::string PmiReader::Standard() const {
  const std::string schema = file_.schema();
  if (schema.starts_with("AP242")) return "AP242";
  if (schema.starts_with("AUTOMOTIVE_DESIGN")) return "AP214";
  if (schema.starts_with("CONFIG_CONTROL") || schema.starts_with("AP203")) return "AP203";
  return schema.empty() ? "STEP" : "STEP " + schema.substr(0, 40);
}

void PmiReader::NoteGraphicAnnotations() {
  const auto graphic = [](std::string_view type) {
    return type == "DRAUGHTING_CALLOUT" || type.ends_with("ANNOTATION_OCCURRENCE");
  };
  const size_t count = file_.Find(graphic).size();
  if (count == 0) return;
  pmi_.report.notes.push_back(
      std::to_string(count) +
      " annotations are in the file as graphics only, without values that could be read; export "
      "it with semantic PMI (AP242)");
}

}  // namespace sightline::step_pmi

namespace sightline {

StepPmi ReadStepPmi(const Part21File& file) { return step_pmi::PmiReader(file).Read(); }

}  // namespace sightline
