// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/multipart_reader.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/status/status_macros.h"
#include "planning_service/http/request_target.h"

namespace sightline {
namespace {

constexpr size_t kMaxHeaderBytes = 8 << 10;
constexpr size_t kMaxBoundaryBytes = 70;  // RFC 2046

// Takes "; name=value" or "; name="value"" from the front of `text`.
bool TakeParameter(absl::string_view* text, std::string* name, std::string* value) {
  absl::string_view rest = absl::StripLeadingAsciiWhitespace(*text);
  if (rest.empty() || rest.front() != ';') return false;
  rest = absl::StripLeadingAsciiWhitespace(rest.substr(1));
  const size_t equals = rest.find('=');
  if (equals == absl::string_view::npos) return false;
  *name = absl::AsciiStrToLower(absl::StripAsciiWhitespace(rest.substr(0, equals)));
  rest = absl::StripLeadingAsciiWhitespace(rest.substr(equals + 1));
  value->clear();
  if (rest.empty() || rest.front() != '"') {
    const size_t end = std::min(rest.find(';'), rest.size());
    *value = std::string(absl::StripAsciiWhitespace(rest.substr(0, end)));
    *text = rest.substr(end);
    return true;
  }
  for (size_t i = 1; i < rest.size(); ++i) {
    if (rest[i] == '"') {
      *text = rest.substr(i + 1);
      return true;
    }
    // Other backslashes belong to the name: some clients send Windows paths.
    if (rest[i] == '\\' && i + 1 < rest.size() && (rest[i + 1] == '"' || rest[i + 1] == '\\')) ++i;
    *value += rest[i];
  }
  return false;
}

// Decodes only the characters that browsers encode in quoted names: a percent sign stays as it is
// (WHATWG HTML, multipart form data).
std::string DecodeFormName(const std::string& name) {
  return absl::StrReplaceAll(
      name, {{"%22", "\""}, {"%0D", "\r"}, {"%0d", "\r"}, {"%0A", "\n"}, {"%0a", "\n"}});
}

// RFC 8187: "UTF-8''na%C3%AFve.stl".
absl::StatusOr<std::string> DecodeExtended(absl::string_view value) {
  constexpr absl::string_view kPrefix = "utf-8'";
  const size_t quote =
      absl::StartsWithIgnoreCase(value, kPrefix) ? value.find('\'', kPrefix.size()) : value.npos;
  if (quote == value.npos) return absl::InvalidArgumentError("not UTF-8''...");
  return PercentDecode(value.substr(quote + 1));
}

}  // namespace

absl::StatusOr<std::string> MultipartBoundary(const std::string& content_type) {
  absl::string_view rest = content_type;
  rest.remove_prefix(std::min(rest.find(';'), rest.size()));
  std::string name;
  std::string value;
  while (TakeParameter(&rest, &name, &value)) {
    if (name != "boundary") continue;
    if (value.empty() || value.size() > kMaxBoundaryBytes || HasControlCharacters(value)) break;
    return value;
  }
  return absl::InvalidArgumentError(
      "Content-Type: multipart/form-data must have a boundary of 1 to 70 characters");
}

MultipartReader::MultipartReader(const std::string& boundary, Source source)
    : delimiter_("\r\n--" + boundary), source_(std::move(source)), buffer_("\r\n") {}

absl::Status MultipartReader::Error(absl::string_view reason) const {
  return absl::InvalidArgumentError(
      absl::StrCat("multipart/form-data, part ", parts_, ": ", reason));
}

absl::Status MultipartReader::Fill() {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string piece, source_());
  if (piece.empty()) return Error("the body ends before the last boundary");
  buffer_ += piece;
  return absl::OkStatus();
}

absl::StatusOr<std::string> MultipartReader::Read() {
  while (in_part_) {
    const size_t at = buffer_.find(delimiter_);
    if (at == 0) {
      in_part_ = false;
      break;
    }
    // The end of the buffer may be the beginning of a delimiter, so it is kept back.
    const size_t content = at != std::string::npos ? at
                           : buffer_.size() >= delimiter_.size()
                               ? buffer_.size() - delimiter_.size() + 1
                               : 0;
    if (content > 0) {
      std::string piece = buffer_.substr(0, content);
      buffer_.erase(0, content);
      return piece;
    }
    SIGHTLINE_RETURN_IF_ERROR(Fill());
  }
  return "";
}

absl::StatusOr<std::optional<MultipartPart>> MultipartReader::NextPart() {
  while (in_part_) {
    SIGHTLINE_RETURN_IF_ERROR(Read().status());
  }
  if (ended_) return std::nullopt;
  ++parts_;
  buffer_.erase(0, delimiter_.size());
  // White space may follow a boundary.
  size_t end = std::string::npos;
  while ((end = buffer_.find("\r\n")) == std::string::npos && !absl::StartsWith(buffer_, "--")) {
    if (buffer_.size() > kMaxHeaderBytes) return Error("a boundary must end its line");
    SIGHTLINE_RETURN_IF_ERROR(Fill());
  }
  if (absl::StartsWith(buffer_, "--")) {
    ended_ = true;
    return std::nullopt;
  }
  if (end > kMaxHeaderBytes ||
      !absl::StripAsciiWhitespace(absl::string_view(buffer_).substr(0, end)).empty()) {
    return Error("a boundary must end its line");
  }
  buffer_.erase(0, end + 2);
  SIGHTLINE_ASSIGN_OR_RETURN(MultipartPart part, ReadHeader());
  in_part_ = true;
  return part;
}

absl::StatusOr<MultipartPart> MultipartReader::ReadHeader() {
  MultipartPart part;
  bool named = false;
  size_t header_bytes = 0;
  for (;;) {
    size_t end = std::string::npos;
    while ((end = buffer_.find("\r\n")) == std::string::npos) {
      if (buffer_.size() > kMaxHeaderBytes) return Error("its headers are too long");
      SIGHTLINE_RETURN_IF_ERROR(Fill());
    }
    const std::string line = buffer_.substr(0, end);
    buffer_.erase(0, end + 2);
    header_bytes += line.size();
    if (header_bytes > kMaxHeaderBytes) return Error("its headers are too long");
    if (line.empty()) break;
    const size_t colon = line.find(':');
    if (colon == std::string::npos) return Error("a header has no colon");
    if (!absl::EqualsIgnoreCase(absl::StripAsciiWhitespace(line.substr(0, colon)),
                                "content-disposition")) {
      continue;
    }
    const absl::string_view value =
        absl::StripLeadingAsciiWhitespace(absl::string_view(line).substr(colon + 1));
    const size_t semicolon = std::min(value.find(';'), value.size());
    if (!absl::EqualsIgnoreCase(absl::StripAsciiWhitespace(value.substr(0, semicolon)),
                                "form-data")) {
      return Error("its Content-Disposition must be form-data");
    }
    absl::string_view rest = value.substr(semicolon);
    std::string key;
    std::string text;
    std::string extended;
    while (TakeParameter(&rest, &key, &text)) {
      if (key == "name") {
        part.name = DecodeFormName(text);
        named = true;
      } else if (key == "filename") {
        part.filename = DecodeFormName(text);
      } else if (key == "filename*") {
        absl::StatusOr<std::string> decoded = DecodeExtended(text);
        if (!decoded.ok()) return Error("its filename* must be UTF-8''...");
        extended = *std::move(decoded);
      }
    }
    if (!absl::StripAsciiWhitespace(rest).empty()) {
      return Error("its Content-Disposition cannot be read");
    }
    if (!extended.empty()) part.filename = extended;
  }
  if (!named || part.name.empty()) return Error("it has no name");
  return part;
}

}  // namespace sightline
