// SPDX-License-Identifier: Apache-2.0
// Writes messages as JSON for programs: one line, with all fields.
#pragma once

#include <google/protobuf/message.h>

#include <string>

namespace sightline {

// proto3 JSON with original names on one line; has every field except messages that are not set.
// int64 are numbers, times RFC 3339. Messages with maps are not supported: their maps would be
// lists of entries.
std::string MessageJson(const google::protobuf::Message& message);

}  // namespace sightline
