// SPDX-License-Identifier: Apache-2.0
/// \file
/// UTF-8 in texts that others write.
#pragma once

#include <cstddef>
#include <string_view>

namespace flexcomp::host {

/// \return bytes of the UTF-8 character at the start of a text, 0 where there is none (Unicode 15, table 3-7)
std::size_t utf8_length(std::string_view text);

/// Whether a text is UTF-8 that a terminal only shows: without the control characters U+0000 … U+001F and U+007F … U+009F.
bool is_printable(std::string_view text);

}  // namespace flexcomp::host
