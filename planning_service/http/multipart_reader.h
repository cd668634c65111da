// SPDX-License-Identifier: Apache-2.0
// Bodies of type multipart/form-data (RFC 7578), piece by piece.
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

// The boundary of a Content-Type. INVALID_ARGUMENT if there is none or a wrong one.
absl::StatusOr<std::string> MultipartBoundary(const std::string& content_type);

// Holds no more than a piece of `source` and a part's header at a time.
class MultipartReader {
 public:
  // Next piece of the body; empty at its end.
  using Source = std::function<absl::StatusOr<std::string>()>;

  MultipartReader(const std::string& boundary, Source source);

  // The next part, skipping the unread rest of the one before; nullopt after the last.
  // INVALID_ARGUMENT: not multipart/form-data, naming the part; else the source's errors.
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
