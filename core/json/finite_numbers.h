// SPDX-License-Identifier: Apache-2.0
// Finds NaN and infinity in protobuf messages.
#pragma once

#include <optional>
#include <string>

namespace google::protobuf {
class FieldDescriptor;
class Message;
}  // namespace google::protobuf

namespace sightline {

// True if positive infinity is allowed in a field: exposure times of DetectabilityOfMaterial. In
// files it is "Infinity".
bool MayBeInfinite(const google::protobuf::FieldDescriptor& field);

// Path of the first float or double of a message that is NaN, or infinite where that is not
// allowed, such as "plan.scans[2].rotation.w"; nullopt: there is none. Protobuf's JSON may have
// "NaN", which is not a valid value of any of our fields.
std::optional<std::string> FirstNonFiniteField(const google::protobuf::Message& message);

}  // namespace sightline
