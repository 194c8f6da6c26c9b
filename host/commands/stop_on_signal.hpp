// SPDX-License-Identifier: Apache-2.0
/// \file
/// Ctrl-C and SIGTERM as a request to finish with what there is.
#pragma once

#include <csignal>

namespace flexcomp::host {

/// While it lives the first signal is noted and the second one ends the program.
class StopOnSignal {
 public:
  StopOnSignal();
  ~StopOnSignal();
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

  static bool asked();

 private:
  struct sigaction before_interrupt_ {};
  struct sigaction before_terminate_ {};
};

}  // namespace flexcomp::host
