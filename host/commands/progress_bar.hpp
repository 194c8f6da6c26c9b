// SPDX-License-Identifier: Apache-2.0
/// \file
/// A bar on the terminal for what takes longer than a second.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <string>

namespace flexcomp::host {

/// Draws on standard error if that is a terminal, and takes itself away at the end.
class ProgressBar {
 public:
  ProgressBar(std::string what, bool quiet);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// `note` stands behind the bar, where there is something else to say.
  void show(std::size_t done, std::size_t total, const std::string& note = {});

  /// For functions that report their progress; valid as long as the bar.
  std::function<void(std::size_t, std::size_t)> callback() {
    return [this](std::size_t done, std::size_t total) { show(done, total); };
  }

 private:
  std::string what_;
  bool active_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace flexcomp::host
