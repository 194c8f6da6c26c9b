// SPDX-License-Identifier: Apache-2.0
/// \file
/// Failures of the calibrator and the exit status of each (mapped in main.cpp only).
#ifndef FLEXCOMP_HOST_ERRORS_HPP
#define FLEXCOMP_HOST_ERRORS_HPP

#include <stdexcept>

#include "input_error.hpp"

namespace flexcomp::host {

enum class ExitStatus : int {
  done = 0,
  failed = 1,          ///< a fault of this program or of the machine (disk full): none of the others
  usage = 2,           ///< wrong command line
  input_refused = 3,   ///< InputError
  bus = 4,             ///< BusError
  not_trustworthy = 5  ///< DoubtfulResult
};

/// The bus or the device refused or did not answer.
class BusError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The work was done and its files were written, but the result must not be relied on. The message says why, and what
/// would cure it.
class DoubtfulResult : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace flexcomp::host

#endif
