// SPDX-License-Identifier: Apache-2.0
// Numbers of protobuf messages that are no numbers.
#pragma once

#include <optional>
#include <string>

namespace google::protobuf {
class Message;
}

namespace sightline {

// Path of the first float or double of a message that is NaN or infinite, such as
// "plan.scans[2].rotation.w"; none if all are finite. JSON of protobuf can say "NaN", and no field
// of ours means anything by it.
std::optional<std::string> FirstNonFiniteField(const google::protobuf::Message& message);

}  // namespace sightline
