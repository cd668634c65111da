// SPDX-License-Identifier: Apache-2.0
#include "core/part/gltf_buffer_files.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "core/text/text_encoding.h"

namespace sightline {
namespace {

// Takes the strings at buffers[i].uri.
class BufferUris : public nlohmann::json_sax<nlohmann::json> {
 public:
  std::vector<GltfBufferFile> files;

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool string(string_t& text) override {
    constexpr int kDepthOfUri = 3;  // the file, its list of buffers, the buffer
    if (in_buffers_ && depth_ == kDepthOfUri && key_ == "uri" && !text.starts_with("data:")) {
      files.push_back({absl::StrCat("buffers[", index_, "].uri"), DecodedUri(text)});
    }
    return true;
  }
  bool key(string_t& name) override {
    key_ = name;
    if (depth_ == 1) in_buffers_ = name == "buffers";
    return true;
  }
  bool start_object(size_t) override {
    if (in_buffers_ && depth_ == 2) ++index_;
    return ++depth_ <= kMostDepth;
  }
  bool end_object() override {
    --depth_;
    return true;
  }
  bool start_array(size_t) override {
    if (in_buffers_ && depth_ == 1) index_ = -1;
    return ++depth_ <= kMostDepth;
  }
  bool end_array() override {
    --depth_;
    return true;
  }
  bool parse_error(size_t, const std::string&, const nlohmann::detail::exception&) override {
    return false;
  }

 private:
  static constexpr int kMostDepth = 64;

  int depth_ = 0;
  int index_ = -1;  // of the buffer
  bool in_buffers_ = false;
  std::string key_;
};

}  // namespace

std::string DecodedUri(std::string_view uri) {
  std::string decoded;
  for (size_t i = 0; i < uri.size(); ++i) {
    const auto digit = [&](size_t at) -> int {
      if (at >= uri.size()) return -1;
      const char c = absl::ascii_tolower(static_cast<unsigned char>(uri[at]));
      return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
    };
    if (uri[i] == '%' && digit(i + 1) >= 0 && digit(i + 2) >= 0) {
      decoded += static_cast<char>(16 * digit(i + 1) + digit(i + 2));
      i += 2;
    } else {
      decoded += uri[i];
    }
  }
  return decoded;
}

absl::StatusOr<std::vector<GltfBufferFile>> GltfBufferFiles(std::string_view json) {
  SIGHTLINE_ASSIGN_OR_RETURN(const std::string_view unmarked, WithoutByteOrderMark(json));
  const std::string_view text = WithoutEndMarks(unmarked);
  BufferUris uris;
  if (!nlohmann::json::sax_parse(text.begin(), text.end(), &uris)) {
    return absl::InvalidArgumentError("truncated or damaged: its JSON does not parse");
  }
  return std::move(uris.files);
}

}  // namespace sightline
