// SPDX-License-Identifier: Apache-2.0
/// \file
/// Nearest known name by edit distance, for "did you mean" messages.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace flexcomp::host {

/// The nearest of `known` by edit distance, or empty where none is near (more than a third of the name differs).
std::string nearest(std::string_view name, std::span<const std::string> known);

/// What was expected in place of a wrong name: "`a_known` (did you mean 'b'?)" where one is near, else "`one_of` a, b, c".
std::string expected_name(std::string_view wrong, std::span<const std::string> known, std::string_view one_of,
                          std::string_view a_known);

}  // namespace flexcomp::host
