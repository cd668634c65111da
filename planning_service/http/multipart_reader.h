// SPDX-License-Identifier: Apache-2.0
// Reads bodies of type multipart/form-data (RFC 7578) piece by piece.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace sightline {

struct MultipartPart {
  std::string name;      // of the form's field
  std::string filename;  // empty: none
};

// The boundary of a Content-Type. INVALID_ARGUMENT if it is missing or not valid.
absl::StatusOr<std::string> MultipartBoundary(const std::string& content_type);

// Holds at most one piece of `source` and one part's headers in memory.
class MultipartReader {
 public:
  // Next piece of the body; empty at its end.
  using Source = std::function<absl::StatusOr<std::string>()>;

  MultipartReader(const std::string& boundary, Source source);

  // Skips the unread rest of the current part and returns the next one; nullopt after the last.
  // INVALID_ARGUMENT names the part: it is not multipart/form-data. Also errors of the source.
  absl::StatusOr<std::optional<MultipartPart>> NextPart();
  // Next piece of the part's content; empty at its end.
  absl::StatusOr<std::string> Read();

 private:
  absl::Status Fill();
  absl::Status Error(absl::string_view reason) const;
  absl::StatusOr<MultipartPart> ReadHeader();

  const std::string delimiter_;  // with the line break before it, which belongs to it
  const Source source_;
  std::string buffer_;
  int parts_ = 0;
  bool in_part_ = true;  // text before the first delimiter is skipped like a part
  bool ended_ = false;
};

}  // namespace sightline
