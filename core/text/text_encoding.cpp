// SPDX-License-Identifier: Apache-2.0
#include "core/text/text_encoding.h"

#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

constexpr std::string_view kUtf8Mark = "\xef\xbb\xbf";

struct OtherMark {
  std::string_view bytes;
  const char* encoding;
};
// The mark of UTF-32 starts with that of UTF-16.
constexpr OtherMark kOtherMarks[] = {{std::string_view("\xff\xfe\0\0", 4), "UTF-32"},
                                     {std::string_view("\0\0\xfe\xff", 4), "UTF-32"},
                                     {"\xff\xfe", "UTF-16"},
                                     {"\xfe\xff", "UTF-16"}};

}  // namespace

absl::StatusOr<std::string_view> WithoutByteOrderMark(std::string_view text) {
  for (const OtherMark& mark : kOtherMarks) {
    if (!text.starts_with(mark.bytes)) continue;
    return absl::InvalidArgumentError(absl::StrCat("starts with the byte order mark of ",
                                                   mark.encoding, ": save the file as UTF-8 text"));
  }
  if (text.starts_with(kUtf8Mark)) text.remove_prefix(kUtf8Mark.size());
  return text;
}

std::string_view WithoutEndMarks(std::string_view text) {
  constexpr std::string_view kEndMarks("\0\x1a \t\r\n\v\f", 8);
  const size_t last = text.find_last_not_of(kEndMarks);
  return text.substr(0, last == std::string_view::npos ? 0 : last + 1);
}

}  // namespace sightline
