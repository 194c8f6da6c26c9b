// SPDX-License-Identifier: Apache-2.0
/// \file
/// Failures of the calibrator and the exit status of each (mapped in run() of commands/ only).
#ifndef FLEXCOMP_HOST_ERRORS_HPP
#define FLEXCOMP_HOST_ERRORS_HPP

#include <stdexcept>

#include "input_error.hpp"

namespace flexcomp::host {

enum class ExitStatus : int {
  done = 0,
  failed = 1,          ///< a fault of this program or of the machine (disk full): none of the others
  usage = 2,           ///< wrong command line, ArgumentError
  input_refused = 3,   ///< InputError
  bus = 4,             ///< BusError
  not_trustworthy = 5  ///< DoubtfulResult
};

/// The bus or the device refused or did not answer. Message: `can:vcan0:5: there is no interface 'vcan0'`.
class BusError : public std::runtime_error {
 public:
  BusError(const std::string& address, const std::string& text, ErrorCode code = ErrorCode::none)
      : std::runtime_error(address + ": " + text), address_(address), code_(code) {}
  const std::string& address() const { return address_; }
  ErrorCode code() const { return code_; }

 private:
  std::string address_;
  ErrorCode code_;
};

/// An argument of a call that does not suit the other input. What it is called is the caller's to say.
class ArgumentError : public std::runtime_error {
 public:
  ArgumentError(ErrorCode code, const std::string& what) : std::runtime_error(what), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

/// The work was done and its files were written, but the result must not be relied on. The message says why, and what
/// would cure it.
class DoubtfulResult : public std::runtime_error {
 public:
  explicit DoubtfulResult(const std::string& what, ErrorCode code = ErrorCode::none)
      : std::runtime_error(what), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

}  // namespace flexcomp::host

#endif
