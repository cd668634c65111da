// SPDX-License-Identifier: Apache-2.0
// Numbers of an inspection that a diagnosis may change, addressed by field paths.
#pragma once

#include <google/protobuf/message.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/v1/inspection.pb.h"

namespace sightline {

struct NumberRange {
  // Dotted path such as "laser.power_w"; a repeated field stands for all its elements.
  std::string_view path;
  // Default of an unstated number; if it has none, only a stated number is changed.
  std::optional<double> unset;
  double lower, upper;
  // Meaning of an unstated number for the warning; if empty, no warning is needed.
  std::string_view meaning_of_unset = {};
};

// Returns nullptr if an inspection has no such number, or if it must not be changed.
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

// The numbers at the path of `range`. If an unstated number has a default, missing messages on the
// path are added. For `materials`, only the elements with these indices are included.
std::vector<InspectionNumber> NumbersAt(const NumberRange& range,
                                        const std::vector<int>& material_indices,
                                        v1::Inspection* inspection);

}  // namespace sightline
