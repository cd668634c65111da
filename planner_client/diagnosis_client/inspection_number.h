// SPDX-License-Identifier: Apache-2.0
// Numbers of an inspection that a diagnosis may change, found by their field paths.
#pragma once

#include <google/protobuf/message.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/v1/inspection.pb.h"

namespace sightline {

struct NumberRange {
  // Dotted path, "laser.power_w"; through a repeated field to all its elements.
  std::string_view path;
  // The value that an inspection has if it does not state one. None: only stated numbers change.
  std::optional<double> unset;
  double lower, upper;
  // Meaning of an unstated number, for people. Empty: no warning is due.
  std::string_view meaning_of_unset = {};
};

// nullptr: an inspection has no such number, or none that may change.
const NumberRange* FindNumberRange(std::string_view path);

// One number (or flag, 0 and 1) of a message of the inspection.
struct InspectionNumber {
  google::protobuf::Message* message;
  const google::protobuf::FieldDescriptor* field;
  const NumberRange* range;
  std::string path;  // "materials[0].material.lambert_ggx.ggx_alpha"

  bool IsStated() const;
  // The stated or default value; 0 if the range has no such value.
  double Get() const;
  void Set(double value) const;
};

// The numbers at the path of `range`; messages on the way are added if an unstated number has a
// value. The path through `materials` leads to the elements of these indices only.
std::vector<InspectionNumber> NumbersAt(const NumberRange& range,
                                        const std::vector<int>& material_indices,
                                        v1::Inspection* inspection);

}  // namespace sightline
