// SPDX-License-Identifier: Apache-2.0
#include "core/text/printable.h"

#include <array>
#include <cstdio>

namespace sightline {
namespace {

// The code point of a character of writing direction that begins `text`, 0 for any other: U+061C,
// U+200E, U+200F, U+202A to U+202E and U+2066 to U+2069 (Unicode 15, PropList.txt, Bidi_Control).
unsigned BidiControl(std::string_view text) {
  const auto byte = [&](size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
  };
  if (byte(0) == 0xd8 && byte(1) == 0x9c) return 0x61c;
  if (byte(0) != 0xe2 || byte(1) < 0x80 || byte(1) > 0x81 || (byte(2) & 0xc0) != 0x80) return 0;
  const unsigned code = 0x2000 | (byte(1) & 0x3f) << 6 | (byte(2) & 0x3f);
  const bool controls = code == 0x200e || code == 0x200f || (code >= 0x202a && code <= 0x202e) ||
                        (code >= 0x2066 && code <= 0x2069);
  return controls ? code : 0;
}

}  // namespace

std::string Printable(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  const auto escape = [&](unsigned char byte) {
    std::array<char, 5> hex{};
    std::snprintf(hex.data(), hex.size(), "\\x%02x", byte);
    out += hex.data();
  };
  for (size_t i = 0; i < text.size(); ++i) {
    const unsigned char byte = static_cast<unsigned char>(text[i]);
    const unsigned char after = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0;
    if ((byte < 0x20 && byte != '\n' && byte != '\t') || byte == 0x7f) {
      escape(byte);
    } else if (byte == 0xc2 && after >= 0x80 && after < 0xa0) {  // C1 in UTF-8
      escape(after);
      ++i;
    } else if (const unsigned code = BidiControl(text.substr(i)); code != 0) {
      std::array<char, 7> hex{};
      std::snprintf(hex.data(), hex.size(), "\\u%04x", code);
      out += hex.data();
      i += code < 0x800 ? 1 : 2;  // bytes of its UTF-8 after the first
    } else {
      out += text[i];
    }
  }
  return out;
}

}  // namespace sightline
