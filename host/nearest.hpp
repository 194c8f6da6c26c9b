// SPDX-License-Identifier: Apache-2.0
/// \file
/// "Did you mean": the known name that an unknown one was probably meant to be.
#ifndef FLEXCOMP_HOST_NEAREST_HPP
#define FLEXCOMP_HOST_NEAREST_HPP

#include <span>
#include <string>
#include <string_view>

namespace flexcomp::host {

/// The nearest of `known` by edit distance, or empty where none is near (more than a third of the name differs).
std::string nearest(std::string_view name, std::span<const std::string> known);

}  // namespace flexcomp::host

#endif
