// SPDX-License-Identifier: Apache-2.0
#include "commands/progress_bar.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

namespace flexcomp::host {

using std::chrono::steady_clock;

ProgressBar::ProgressBar(std::string what, bool quiet)
    : what_(std::move(what)),
      active_(!quiet && ::isatty(STDERR_FILENO) == 1),
      start_(steady_clock::now()),
      next_(start_ + std::chrono::seconds(1)) {}

ProgressBar::~ProgressBar() {
  if (drawn_) std::fputs("\r\033[K", stderr);
}

void ProgressBar::show(std::size_t done, std::size_t total, const std::string& note) {
  if (!active_ || total == 0) return;
  const auto now = steady_clock::now();
  if (now < next_) return;
  next_ = now + std::chrono::milliseconds(100);
  drawn_ = true;
  constexpr std::size_t width = 30;
  const std::size_t filled = std::min(width, width * done / total);
  const double passed = std::chrono::duration<double>(now - start_).count();
  const double left =
      done == 0 ? 0 : passed * static_cast<double>(total - std::min(done, total)) / static_cast<double>(done);
  fmt::print(stderr, "\r\033[K{} [{}{}] {} of {}, {:.0f} s left{}{}", what_, std::string(filled, '#'),
             std::string(width - filled, ' '), done, total, left, note.empty() ? "" : "; ", note);
  std::fflush(stderr);
}

}  // namespace flexcomp::host
