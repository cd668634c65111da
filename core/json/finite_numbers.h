// SPDX-License-Identifier: Apache-2.0
// Numbers of protobuf messages that are no numbers.
#pragma once

#include <optional>
#include <string>

namespace google::protobuf {
class FieldDescriptor;
class Message;
}  // namespace google::protobuf

namespace sightline {

// Whether positive infinity has a meaning in a field: exposure times of DetectabilityOfMaterial.
// Files write it as "Infinity".
bool MayBeInfinite(const google::protobuf::FieldDescriptor& field);

// Path of the first float or double of a message that is NaN or infinite, such as
// "plan.scans[2].rotation.w"; none if all are finite, or infinite where they may be. JSON of
// protobuf can say "NaN", and no field of ours means anything by it.
std::optional<std::string> FirstNonFiniteField(const google::protobuf::Message& message);

}  // namespace sightline
