// SPDX-License-Identifier: Apache-2.0
/// \file
/// Helpers for text readers.
#pragma once

#include <string>
#include <string_view>

namespace flexcomp::host {

/// Removes blanks and tabs at both ends.
std::string_view trimmed(std::string_view text);

/// Converts ASCII letters to lower case; other bytes stay.
std::string lower(std::string_view text);

}  // namespace flexcomp::host
