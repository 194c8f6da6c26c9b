// SPDX-License-Identifier: Apache-2.0
/// \file
/// What an action throws, for a test to look at.
#pragma once

#include <stdexcept>

namespace support {

/// The Error that `action` throws; the test fails where it throws nothing or something else.
template <class Error, class Action>
Error thrown(const Action& action) {
  try {
    action();
  } catch (const Error& error) {
    return error;
  }
  throw std::logic_error("nothing was thrown");
}

}  // namespace support
