// SPDX-License-Identifier: Apache-2.0
/// \file
/// Failures of the calibrator and the exit status of each (mapped in run() of commands/ only).
#pragma once

#include <stdexcept>

#include "input_error.hpp"

namespace flexcomp::host {

enum class ExitStatus : int {
  done = 0,
  failed = 1,          ///< a fault of this program or of the machine (disk full): none of the others
  usage = 2,           ///< wrong command line, ArgumentError
  input_refused = 3,   ///< InputError
  bus = 4,             ///< BusError
  not_trustworthy = 5  ///< DoubtfulResult, also a push that ended open
};

/// What an error is about beside its message.
class CodedError : public std::runtime_error {
 public:
  CodedError(const std::string& what, ErrorCode code) : std::runtime_error(what), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

/// The bus or the device refused or did not answer. Message: `can:vcan0:5: there is no interface 'vcan0'`.
class BusError : public CodedError {
 public:
  BusError(const std::string& address, const std::string& text, ErrorCode code = ErrorCode::none)
      : CodedError(address + ": " + text, code), address_(address), text_(text) {}
  const std::string& address() const { return address_; }
  const std::string& text() const { return text_; }  ///< without the address

 private:
  std::string address_;
  std::string text_;
};

/// An argument of a call that does not suit the other input. What it is called is the caller's to say.
class ArgumentError : public CodedError {
 public:
  ArgumentError(ErrorCode code, const std::string& what) : CodedError(what, code) {}
};

/// The work was done and its files were written, but the result must not be relied on. The message says why, and what
/// would cure it.
class DoubtfulResult : public CodedError {
 public:
  explicit DoubtfulResult(const std::string& what, ErrorCode code = ErrorCode::none)
      : CodedError(what, code) {}
};

}  // namespace flexcomp::host
