// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/plain_text.h"

#include <cstdint>

namespace sightline {
namespace {

// Length [bytes] of the character at the start of `text`, which is not empty; 0: not valid.
size_t CharacterBytes(absl::string_view text) {
  const auto lead = static_cast<unsigned char>(text[0]);
  if (lead == 0) return 0;
  if (lead < 0x80) return 1;
  const size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < length) return 0;
  uint32_t character = lead & (0x7f >> length);
  for (size_t i = 1; i < length; ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if ((byte & 0xc0) != 0x80) return 0;
    character = character << 6 | (byte & 0x3f);
  }
  // Overlong encodings, halves of a surrogate pair and numbers beyond Unicode are not valid.
  if (length == 3 && character < 0x800) return 0;
  if (length == 4 && character < 0x10000) return 0;
  if ((character >= 0xd800 && character <= 0xdfff) || character > 0x10ffff) return 0;
  return length;
}

}  // namespace

bool IsPlainText(absl::string_view text) {
  while (!text.empty()) {
    const size_t bytes = CharacterBytes(text);
    if (bytes == 0) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

std::string ToPlainText(absl::string_view text, size_t max_bytes) {
  std::string plain;
  while (!text.empty()) {
    const size_t bytes = CharacterBytes(text);
    const absl::string_view character = bytes > 0 ? text.substr(0, bytes) : "\xef\xbf\xbd";
    if (plain.size() + character.size() > max_bytes) break;
    plain.append(character.data(), character.size());
    text.remove_prefix(bytes > 0 ? bytes : 1);
  }
  return plain;
}

}  // namespace sightline
