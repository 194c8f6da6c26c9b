// SPDX-License-Identifier: Apache-2.0
/// \file
/// Helpers for text readers.
#ifndef FLEXCOMP_HOST_FILES_TEXT_HPP
#define FLEXCOMP_HOST_FILES_TEXT_HPP

#include <string>
#include <string_view>

namespace flexcomp::host {

/// Removes blanks and tabs at both ends.
std::string_view trimmed(std::string_view text);

/// Converts ASCII letters to lower case; other bytes stay.
std::string lower(std::string_view text);

}  // namespace flexcomp::host

#endif
