// SPDX-License-Identifier: Apache-2.0
/// \file
/// An identification as text for the terminal.
#ifndef FLEXCOMP_HOST_COMMANDS_IDENTIFICATION_TEXT_HPP
#define FLEXCOMP_HOST_COMMANDS_IDENTIFICATION_TEXT_HPP

#include <cstddef>
#include <string>
#include <vector>

#include "identification/identify.hpp"

namespace flexcomp::host {

/// \param data, out  the files
/// \param rows       how many were fitted
std::vector<std::string> text_lines(const Identification& r, const Robot& robot, const std::string& data,
                                    std::size_t rows, const std::string& out);

/// Why the result is not trustworthy, with the poses that would identify them.
std::string doubts_text(const Identification& r);

}  // namespace flexcomp::host

#endif
