// SPDX-License-Identifier: Apache-2.0
/// \file
/// Wait-free handover of a parameter set from the background to the control cycle: a request word that only
/// the background writes and an acknowledgement that only the cycle writes. The cycle reads the request once,
/// never waits and never retries; the background may touch a model only when the cycle has acknowledged that
/// it uses another one.
///
/// The countdown of a trial runs in the cycle: a set on trial reverts also when the background hangs.
#ifndef FLEXCOMP_FIRMWARE_HANDOVER_HPP
#define FLEXCOMP_FIRMWARE_HANDOVER_HPP

#include <atomic>
#include <cstdint>

namespace flexcomp {
namespace firmware {

/// Request and acknowledgement words, and the countdown of a trial.
class Handover {
 public:
  static constexpr std::uint32_t none = 2;  ///< no set: commands are passed through

  // --- background -------------------------------------------------------------------------------------

  /// Asks the cycle to use model `index` (0, 1 or none) from its next start on.
  void activate(std::uint32_t index) { post(index, 0); }

  /// The same, but back to `fallback` after `cycles` control cycles (at least 1) unless confirm() comes
  /// before.
  void activate_on_trial(std::uint32_t index, std::uint32_t fallback, std::uint32_t cycles) {
    trial_cycles_.store(cycles, std::memory_order_relaxed);
    post(index, trial_bit | (fallback << fallback_shift));
  }

  /// Ends the trial in favour of the set on trial. Only when settled(); afterwards wait for settled() and
  /// look at reverted(): the trial may have run out just before.
  void confirm() { post(requested(), confirm_bit); }

  /// True when the cycle has seen the last request.
  bool settled() const {
    return (taken_.load(std::memory_order_acquire) ^ request_.load(std::memory_order_relaxed)) <
           (1U << generation_shift);
  }

  /// The model of the last request.
  std::uint32_t requested() const { return request_.load(std::memory_order_relaxed) & index_mask; }

  /// The model that the cycle uses; exact only while settled().
  std::uint32_t in_use() const { return taken_.load(std::memory_order_acquire) & index_mask; }

  /// True when the last trial ran out. Exact only while settled().
  bool reverted() const { return (taken_.load(std::memory_order_acquire) & reverted_bit) != 0; }

  /// Control cycles until the trial runs out; 0 where there is none.
  std::uint32_t trial_cycles_left() const { return left_.load(std::memory_order_relaxed); }

  // --- both contexts, also at the same time -----------------------------------------------------------

  /// A model whose contents stand still for as long as the caller's context does neither take() nor activate: the one that
  /// the cycle uses, or the requested one where the cycle has not seen the request yet. Changes nothing. Only the background
  /// writes models; it writes the one not in use, after the cycle has acknowledged the last request.
  std::uint32_t readable() const {
    const std::uint32_t request = request_.load(std::memory_order_acquire);
    const std::uint32_t taken = taken_.load(std::memory_order_acquire);
    return ((request ^ taken) < (1U << generation_shift) ? taken : request) & index_mask;
  }

  // --- control cycle ----------------------------------------------------------------------------------

  /// The model to use in this cycle (0, 1 or none); `changed`: another one than in the cycle before.
  std::uint32_t take(bool& changed) {
    const std::uint32_t request = request_.load(std::memory_order_acquire);
    changed = false;
    if (request != seen_) {
      seen_ = request;
      if ((request & confirm_bit) != 0) {
        on_trial_ = false;  // a trial that has run out stays reverted
      } else {
        index_ = request & index_mask;
        reverted_ = false;
        on_trial_ = (request & trial_bit) != 0;
        if (on_trial_) trial_left_ = trial_cycles_.load(std::memory_order_relaxed);
        changed = true;
      }
      if (!on_trial_) left_.store(0, std::memory_order_relaxed);
    }
    if (on_trial_) {
      if (trial_left_ == 0) {
        index_ = (request >> fallback_shift) & index_mask;
        on_trial_ = false;
        reverted_ = true;
        changed = true;
      } else {
        --trial_left_;
      }
      left_.store(trial_left_, std::memory_order_relaxed);
    }
    taken_.store((request & ~((1U << generation_shift) - 1U)) | index_ | (reverted_ ? reverted_bit : 0U),
                 std::memory_order_release);
    return index_;
  }

 private:
  static_assert(std::atomic<std::uint32_t>::is_always_lock_free, "the control cycle must never wait");

  // Request: bits 0-1 index, 2 trial, 3 confirm, 4-5 fallback. Acknowledgement: bits 0-1 index, 2 reverted.
  // Both: bits 8-31 generation.
  static constexpr std::uint32_t index_mask = 3;
  static constexpr std::uint32_t trial_bit = 4;
  static constexpr std::uint32_t confirm_bit = 8;
  static constexpr std::uint32_t fallback_shift = 4;
  static constexpr std::uint32_t reverted_bit = 4;
  static constexpr std::uint32_t generation_shift = 8;

  void post(std::uint32_t index, std::uint32_t bits) {
    const std::uint32_t generation = (request_.load(std::memory_order_relaxed) >> generation_shift) + 1U;
    request_.store((generation << generation_shift) | bits | index, std::memory_order_release);
  }

  std::atomic<std::uint32_t> request_{none};
  std::atomic<std::uint32_t> taken_{none};
  std::atomic<std::uint32_t> trial_cycles_{0};
  std::atomic<std::uint32_t> left_{0};
  // Of the cycle alone.
  std::uint32_t seen_ = none;
  std::uint32_t index_ = none;
  std::uint32_t trial_left_ = 0;
  bool on_trial_ = false;
  bool reverted_ = false;
};

}  // namespace firmware
}  // namespace flexcomp

#endif
