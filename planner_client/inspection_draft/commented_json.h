// SPDX-License-Identifier: Apache-2.0
// JSON with comments that explain its fields.
#pragma once

#include <google/protobuf/message.h>

#include <map>
#include <string>

namespace sightline {

// Comments by the path of the field that they precede, "targets.spacing_m"; "": before all.
using FieldComments = std::map<std::string, std::string>;

// ToJson with the comments of fields that it writes, a line for every 96 columns, each from `//` to
// the end of its line.
std::string CommentedJson(const google::protobuf::Message& message, const FieldComments& comments);

}  // namespace sightline
