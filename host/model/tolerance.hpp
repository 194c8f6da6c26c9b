// SPDX-License-Identifier: Apache-2.0
/// \file
/// Prior standard deviations of the parameters' differences from nominal.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "model/term_set.hpp"

namespace flexcomp::host {

/// `expected` ± `sigma` (one standard deviation) of the difference from the nominal robot, in the unit that the
/// parameter's name ends with.
struct Tolerance {
  std::string pattern;  ///< a parameter's name, in which * stands for any text: link*.d_mm
  double expected = 0;
  double sigma = 0;
  std::string file;
  std::size_t line = 0;
};

/// Indices of the parameters whose names match the tolerance's pattern.
/// \throws InputError  with file and line where none matches
std::vector<std::size_t> parameters_meant(const Tolerance& tolerance,
                                          const std::vector<Parameter>& parameters);

}  // namespace flexcomp::host
