// SPDX-License-Identifier: Apache-2.0
// Messages as JSON for programs: one line, nothing left out.
#pragma once

#include <google/protobuf/message.h>

#include <string>

namespace sightline {

// proto3 JSON with original names on one line; every field is there except messages that are not
// set; int64 are numbers, times RFC 3339. Messages with maps are not supported: their maps come out
// as lists of entries.
std::string MessageJson(const google::protobuf::Message& message);

}  // namespace sightline
