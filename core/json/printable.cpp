// SPDX-License-Identifier: Apache-2.0
#include "core/json/printable.h"

#include <array>
#include <cstdio>

namespace sightline {

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
    } else {
      out += text[i];
    }
  }
  return out;
}

}  // namespace sightline
