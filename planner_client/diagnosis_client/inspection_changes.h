// SPDX-License-Identifier: Apache-2.0
// Changes numbers of an inspection within their ranges and records the changes.
//
// Fields have dotted paths such as "laser.power_w"; inspection_number.h has the table of their
// defaults and ranges. This module needs no knowledge of single effects.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "planner_client/diagnosis_client/inspection_number.h"
#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

struct CalibratedInspection {
  v1::Inspection inspection;
  std::vector<std::string> changes;   // "laser.power_w 0.023 -> 0.0251 (power_relative)"
  std::vector<std::string> warnings;  // values that could not be carried over, and why
};

// End of a warning about a quantity or an effect that belongs to the recordings' set-up.
inline constexpr char kOfSetUp[] =
    ": is of the set-up of the recordings, not of camera, lens or laser: left out";

class InspectionChanges {
 public:
  // `result` must outlive this object.
  explicit InspectionChanges(CalibratedInspection* result) : result_(*result) {}

  // Indices of the `materials` that paths change; none unless set.
  void set_plate_materials(std::vector<int> indices) { plate_materials_ = std::move(indices); }

  // Applies all changes of one effect of the diagnosis, in order. An effect without changes (from
  // an older worker), or with an unknown change, is added to the inspection's effects, with a
  // warning. Components are not compared.
  void Carry(const v1::Effect& effect, const std::vector<v1::InspectionChange>& changes);

  // Multiplies the numbers at `path` by a factor, or adds a summand. `source` names the cause in
  // warnings and in the record. Results out of range are clamped, with a warning. `path` must be in
  // the table of numbers.
  void Scale(const std::string& path, double factor, const std::string& source);
  void Shift(const std::string& path, double summand, const std::string& source);

  void Warn(const std::string& text) { result_.warnings.push_back(text); }

 private:
  enum class Outcome {
    kDone,
    kStop,        // stop: no other change of the effect can be applied, as a warning says
    kKeepEffect,  // the effect itself is added instead of its changes
  };
  Outcome Apply(const v1::InspectionChange& change);
  Outcome ApplyToNumber(const InspectionNumber& number, const v1::InspectionChange& change);
  void Change(const InspectionNumber& number, double to, const std::string& source);
  // Adds the effect to the inspection's effects; it replaces one with the same id.
  void AddEffect(const v1::Effect& effect);
  void Note(const std::string& text) { result_.changes.push_back(text); }

  CalibratedInspection& result_;
  std::vector<int> plate_materials_;
};

// Changes of `diagnosis` whose source is this effect, in order.
std::vector<v1::InspectionChange> ChangesOf(const v1::Effect& effect,
                                            const v1::Diagnosis& diagnosis);

// Renames the files of an inspection with inline materials so that their paths are relative to
// `folder`.
void NameFilesFrom(const std::string& folder, v1::Inspection* inspection);

}  // namespace sightline
