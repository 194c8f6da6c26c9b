// SPDX-License-Identifier: Apache-2.0
/// \file
/// Helpers for text readers.
#ifndef FLEXCOMP_HOST_FILES_TEXT_HPP
#define FLEXCOMP_HOST_FILES_TEXT_HPP

#include <string>
#include <string_view>

namespace flexcomp::host {

/// Without blanks and tabs at both ends.
std::string_view trimmed(std::string_view text);

/// ASCII letters in lower case; other bytes as they are.
std::string lower(std::string_view text);

}  // namespace flexcomp::host

#endif
