// SPDX-License-Identifier: Apache-2.0
// Reads and writes proto3 JSON files; errors name the field and the reason.
#pragma once

#include <google/protobuf/message.h>

#include <cstddef>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {

// Parses `json` (snake_case names, // comments). INVALID_ARGUMENT names `file`, path of the field
// ("rig.scan_step_m", "obstacles[2].frame") and reason; for an unknown field or enum value also the
// nearest known name. It has one error per line, at most ErrorList::kMostErrors. `message` is
// replaced if there is no error. The text is read in one pass, so that only the text and the
// message take memory. A text whose message would take more than MostMessageBytes is refused:
// `{},{},{}` makes messages of a hundred times its size.
absl::Status ParseStrictJson(std::string json, const std::string& file,
                             google::protobuf::Message* message);

// Limit on the memory [bytes] of the message that ParseStrictJson makes from a text of `text_bytes`
// bytes: ten times the text plus 256 KiB, but at most the text plus 64 MiB.
inline constexpr size_t kMessageBytesPerTextByte = 10;
size_t MostMessageBytes(size_t text_bytes);

// NOT_FOUND if the file cannot be read.
absl::Status ReadStrictJsonFile(const std::string& path, google::protobuf::Message* message);

// Indented JSON, snake_case names, fields with default values left out; the same message gives the
// same bytes. int64 are written as numbers, not strings.
std::string ToJson(const google::protobuf::Message& message);

}  // namespace sightline
