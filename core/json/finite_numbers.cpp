// SPDX-License-Identifier: Apache-2.0
#include "core/json/finite_numbers.h"

#include <google/protobuf/message.h>

#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

// Whether element `index` of a float or double field, or the field itself, has a value of the
// field.
bool IsValue(const Message& message, const Reflection& reflection, const FieldDescriptor& field,
             int index) {
  const bool is_repeated = field.is_repeated();
  if (field.cpp_type() == FieldDescriptor::CPPTYPE_FLOAT) {
    return std::isfinite(is_repeated ? reflection.GetRepeatedFloat(message, &field, index)
                                     : reflection.GetFloat(message, &field));
  }
  const double value = is_repeated ? reflection.GetRepeatedDouble(message, &field, index)
                                   : reflection.GetDouble(message, &field);
  return std::isfinite(value) || (value > 0 && MayBeInfinite(field));
}

}  // namespace

bool MayBeInfinite(const FieldDescriptor& field) {
  return field.full_name() == "sightline.v1.DetectabilityOfMaterial.shortest_exposure_time_s" ||
         field.full_name() == "sightline.v1.DetectabilityOfMaterial.longest_exposure_time_s";
}

// Parsers limit the depth of messages to 100, and so the depth of this recursion.
std::optional<std::string> FirstNonFiniteField(const Message& message) {
  const Reflection& reflection = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    const auto type = field->cpp_type();
    const bool is_real =
        type == FieldDescriptor::CPPTYPE_FLOAT || type == FieldDescriptor::CPPTYPE_DOUBLE;
    if (!is_real && type != FieldDescriptor::CPPTYPE_MESSAGE) continue;
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      std::string name(field->name());
      if (field->is_repeated()) absl::StrAppend(&name, "[", i, "]");
      if (is_real) {
        if (!IsValue(message, reflection, *field, i)) return name;
        continue;
      }
      const Message& inner = field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i)
                                                  : reflection.GetMessage(message, field);
      if (const std::optional<std::string> found = FirstNonFiniteField(inner)) {
        return absl::StrCat(name, ".", *found);
      }
    }
  }
  return std::nullopt;
}

}  // namespace sightline
