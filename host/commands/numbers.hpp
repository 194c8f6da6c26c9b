// SPDX-License-Identifier: Apache-2.0
/// \file
/// Checks of options that are numbers with a fraction. CLI11's own let "nan" pass, for no comparison with it is true.
#ifndef FLEXCOMP_HOST_COMMANDS_NUMBERS_HPP
#define FLEXCOMP_HOST_COMMANDS_NUMBERS_HPP

#include <CLI/CLI.hpp>

namespace flexcomp::host {

/// Each refuses what is no number, nan, and what is beyond a double. One of them belongs to every option that is a double.
CLI::Validator finite_number();
CLI::Validator positive_number();
CLI::Validator non_negative_number();
CLI::Validator number_between(double low, double high);

}  // namespace flexcomp::host

#endif
