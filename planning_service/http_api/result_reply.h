// SPDX-License-Identifier: Apache-2.0
// Sends files in answers: caching, ranges and content types.
#pragma once

#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include "planning_service/http/http_exchange.h"
#include "planning_service/jobs/planning_jobs.h"

namespace sightline {

// Content type by the extension of the name.
std::string ContentTypeOf(const std::string& name);

// True if an If-None-Match names the entity tag (with its quotes).
bool MatchesEntityTag(absl::string_view if_none_match, absl::string_view entity_tag);

struct ByteRange {
  int64_t offset = 0;
  int64_t length = 0;  // 0: none of the file is in the range
};
// The single range that a Range header asks for. nullopt (send the whole file): several ranges, or
// a text that is not a range.
std::optional<ByteRange> ParseByteRange(absl::string_view header, int64_t size_bytes);

// Sends a result piece by piece from its file, or an error.
void ReplyResult(HttpExchange& exchange, const OpenResult& result);

}  // namespace sightline
