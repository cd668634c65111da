// SPDX-License-Identifier: Apache-2.0
// Numbers of an inspection, changed within their ranges, with a record of it.
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "sightline/v1/inspection.pb.h"

namespace sightline {

struct CalibratedInspection {
  v1::Inspection inspection;
  std::vector<std::string> changes;   // "laser.power_w 0.023 -> 0.0251 (power_relative)"
  std::vector<std::string> warnings;  // what could not be carried over, and why
};

// An optional number of a message.
struct Number {
  google::protobuf::Message* message;
  const char* field;
  double unset;  // what it is if it is not given
  double lower, upper;

  const google::protobuf::FieldDescriptor* Descriptor() const;
  double Get() const;
  void Set(double value) const;
};

class InspectionChanges {
 public:
  explicit InspectionChanges(CalibratedInspection* result) : result_(*result) {}

  void Warn(const std::string& text) { result_.warnings.push_back(text); }
  void Note(const std::string& text) { result_.changes.push_back(text); }
  // `path` of the number's message; `source`: of the change. Values out of range are cut, with a
  // warning.
  void Change(const Number& number, const std::string& path, double to, const std::string& source);
  void Scale(const Number& number, const std::string& path, double factor,
             const std::string& source);
  void Shift(const Number& number, const std::string& path, double shift,
             const std::string& source);
  // Among the inspection's effects; one that stands there with the same id is replaced.
  void AddEffect(const v1::Effect& effect);

 private:
  CalibratedInspection& result_;
};

// Renames the files of an inspection with materials inline so that they lead from `folder` to where
// they are.
void NameFilesFrom(const std::string& folder, v1::Inspection* inspection);

}  // namespace sightline
