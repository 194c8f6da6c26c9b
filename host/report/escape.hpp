// SPDX-License-Identifier: Apache-2.0
/// \file
/// Text that comes from files and people, made safe for HTML: element content and attributes.
#ifndef FLEXCOMP_HOST_REPORT_ESCAPE_HPP
#define FLEXCOMP_HOST_REPORT_ESCAPE_HPP

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

namespace flexcomp::host {

/// \return bytes of the UTF-8 character at the start of a text, 0 where there is none (Unicode 15, table 3-7)
inline std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t k) { return k < text.size() ? static_cast<unsigned char>(text[k]) : 0U; };
  const unsigned first = byte(0), second = byte(1);
  const auto follows = [&](std::size_t k) { return (byte(k) & 0xC0U) == 0x80U; };
  if (first < 0x80) return text.empty() ? 0 : 1;
  if (first < 0xC2 || first > 0xF4 || !follows(1)) return 0;
  if (first < 0xE0) return 2;
  // Not a shorter character in more bytes, no half of a pair of UTF-16, nothing beyond U+10FFFF.
  if ((first == 0xE0 && second < 0xA0) || (first == 0xED && second > 0x9F) || !follows(2)) return 0;
  if (first < 0xF0) return 3;
  if ((first == 0xF0 && second < 0x90) || (first == 0xF4 && second > 0x8F) || !follows(3)) return 0;
  return 4;
}

inline std::string escaped(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t bytes = utf8_length(text.substr(at));
    if (bytes != 1) {
      out += bytes == 0 ? std::string_view("\xEF\xBF\xBD") : text.substr(at, bytes);  // U+FFFD
      at += std::max<std::size_t>(bytes, 1);
      continue;
    }
    const char c = text[at++];
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        // Control characters are not allowed in HTML at all, whatever they would mean.
        out += (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') || c == 0x7F ? ' ' : c;
    }
  }
  return out;
}

}  // namespace flexcomp::host

#endif
