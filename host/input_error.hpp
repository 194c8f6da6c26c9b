// SPDX-License-Identifier: Apache-2.0
/// \file
/// Input that is refused: which file, which line, which field, what was expected there and what was found.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

#include "error_code.hpp"

namespace flexcomp::host {

/// Message: `robots/x.yaml:12: joints[3].a_mm: expected a finite number, found 'abc'`. Parts that do not apply are
/// left empty (line 0) and do not appear.
class InputError : public std::runtime_error {
 public:
  InputError(std::string file, std::size_t line, std::string field, std::string expected, std::string found,
             ErrorCode code = ErrorCode::none);

  const std::string& file() const { return file_; }
  std::size_t line() const { return line_; }  ///< from 1; 0 where the whole file is meant
  const std::string& field() const { return field_; }
  const std::string& expected() const { return expected_; }
  const std::string& found() const { return found_; }
  ErrorCode code() const { return code_; }

  /// The same error for those who know more: a code, another file.
  InputError with(ErrorCode code) const { return {file_, line_, field_, expected_, found_, code}; }

 private:
  std::string file_;
  std::size_t line_;
  std::string field_;
  std::string expected_;
  std::string found_;
  ErrorCode code_;
};

}  // namespace flexcomp::host
