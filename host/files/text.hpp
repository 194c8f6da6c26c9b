// SPDX-License-Identifier: Apache-2.0
/// \file
/// Helpers for text readers.
#ifndef FLEXCOMP_HOST_FILES_TEXT_HPP
#define FLEXCOMP_HOST_FILES_TEXT_HPP

#include <cstddef>
#include <string>
#include <string_view>

namespace flexcomp::host {

/// Bytes of a text, from `begin` to before `end`.
struct TextSpan {
  std::size_t begin = 0;
  std::size_t end = 0;
};

/// Removes blanks and tabs at both ends.
std::string_view trimmed(std::string_view text);

/// Converts ASCII letters to lower case; other bytes stay.
std::string lower(std::string_view text);

/// Position of the > that ends an XML tag, from `at` on and outside quotes; npos where there is none.
std::size_t tag_close(std::string_view text, std::size_t at);

}  // namespace flexcomp::host

#endif
