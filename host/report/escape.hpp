/// \file
/// Text that comes from files and people, made safe for HTML: element content and attributes.
#ifndef FLEXCOMP_HOST_REPORT_ESCAPE_HPP
#define FLEXCOMP_HOST_REPORT_ESCAPE_HPP

#include <string>
#include <string_view>

namespace flexcomp::host {

inline std::string escaped(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
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
        out += static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' ? ' ' : c;
    }
  }
  return out;
}

}  // namespace flexcomp::host

#endif
